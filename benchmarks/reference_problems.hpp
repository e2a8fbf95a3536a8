#pragma once

#include "datasets/record.hpp"
#include "datasets/scene.hpp"

#include <functional>
#include <string>
#include <vector>

namespace crampfit::reference {

/// A scene whose answer is known, on any grid.
struct Problem {
    std::string name;
    std::string quantity;       // what is compared
    std::string source;         // of the exact value
    double known_to;            // what the exact value itself is good to, relative
    std::string counted;        // what the grid is counted by: cells per ...
    std::vector<double> cells;  // grids, coarse to fine
    double slowest;             // angular frequency of its slowest vibration, roughly [rad/s]; 0: equilibrium alone
    std::function<Scene(double cells, int points_per_cell)> scene;  // at equilibrium, its load complete after a second
    std::function<double(const Record&)> ratio;                     // what comes out over what is exact
};

std::vector<Problem> problems();

/// A crack of 10 mm into the side of a plate that is `share` times as wide and three times as high, ends free to rotate, under
/// 0.1 MPa; K_I by the secant form of Tada, Paris and Irwin (2000, 2.11), good to 0.5 % at any share [Pa sqrt(m)].
Scene edge_crack(double cells, double share, int points_per_cell);
double edge_crack_K(double share);

/// REFERENCES' beam: 100 x 24 mm, tip at 51 mm, E = 100 kPa, 0.4 N/m at 99.5 mm, plane strain; G with each arm on the other's
/// elastic half (Kanninen 1973) [J/m^2].
Scene double_cantilever(double cells, int points_per_cell);
double double_cantilever_G();

/// The scene in damped motion that comes to the same rest: loaded over one period of the slowest vibration, critically damped,
/// and followed until what moves has died out to 1e-4.
Scene in_damped_motion(Scene scene, double slowest);

}  // namespace crampfit::reference
