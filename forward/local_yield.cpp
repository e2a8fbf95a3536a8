#include "forward/local_yield.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

constexpr double margin = 6.0;  // of the box about the facets, in cells

// What is cut out. Its sides that are not the specimen's own are held.
Scene scene_in(const Scene& whole, const Box& box, double cell) {
    Scene scene = whole;
    scene.model.cell = cell;
    scene.specimen.size = box.high - box.low;
    const auto move = [&](Shape& shape) {
        if (auto* circle = std::get_if<Circle>(&shape)) circle->centre -= box.low;
        else
            for (Vec2& x : std::get<Polygon>(shape).points) x -= box.low;
    };
    for (Shape& shape : scene.specimen.cutouts) move(shape);
    for (Part& part : scene.specimen.parts) move(part.shape);
    scene.cracks.clear();
    scene.bodies.clear();
    scene.edges.clear();
    return scene;
}

void hold_sides(Scene& scene, const Discretisation& body, const Box& box, const Vec2& size) {
    const Vec2 hair = 1e-6 * size;
    const auto hold = [&](Side side, int axis, bool high) {
        const double end = high ? body.layout.size()[axis] : 0.0;
        for (int p = 0; p < body.points.count(); ++p) {
            const Box domain = body.domain(p);
            if (std::abs((high ? domain.high : domain.low)[axis] - end) > hair[axis]) continue;
            scene.edges.push_back({"", side, {}, {0.0, 0.0}, {}, {}});
            return;
        }
    };
    if (box.low.x() > hair.x()) hold(Side::left, 0, false);
    if (box.high.x() < size.x() - hair.x()) hold(Side::right, 0, true);
    if (box.low.y() > hair.y()) hold(Side::bottom, 1, false);
    if (box.high.y() < size.y() - hair.y()) hold(Side::top, 1, true);
}

}  // namespace

// The box on one grid, and the loads of the stations on its nodes.
struct LocalYield::Solved {
    Solved(const Scene& whole, const Plan& plan, const MaterialMap& wood, const Box& place, double cell)
        : box(place), small(plan), scene(scene_in(whole, place, cell)), materials(wood.part(place.low)), body(scene, materials) {
        small.rotates = small.friction = small.contact = small.remembers = small.free_bodies = false;
        small.linear = true;
        hold_sides(scene, body, place, whole.specimen.size);
        if (!scene.edges.empty()) equilibrium = std::make_unique<Equilibrium>(scene, small, materials, body);
    }

    // Displacements for the load of each station, and what these stations yield.
    bool solve() {
        if (!equilibrium->relax(std::vector<Vec2>(loads.front().size(), Vec2::Zero()))) return false;
        for (const auto& load : loads) states.push_back(equilibrium->yield_to(load).fields);
        return true;
    }

    Eigen::MatrixXd product(const std::vector<std::vector<Vec2>>& with) const {
        Eigen::MatrixXd found(states.size(), with.size());
        for (std::size_t s = 0; s < states.size(); ++s)
            for (std::size_t t = 0; t < with.size(); ++t) {
                double sum = 0.0;
                for (std::size_t f = 0; f < with[t].size(); ++f) sum += with[t][f].dot(states[s][f]);
                found(s, t) = sum;
            }
        return found;
    }

    Box box;
    Plan small;
    Scene scene;
    MaterialMap materials;
    Discretisation body;
    std::unique_ptr<Equilibrium> equilibrium;
    std::vector<std::vector<Vec2>> loads;   // [stations][nodes] of unit forces
    std::vector<std::vector<Vec2>> states;  // [stations][nodes] [m/N]
    std::vector<MaterialSlope> numbers;
};

std::shared_ptr<LocalYield> LocalYield::about(const Box& where, const SlidingBody& rigid, const Scene& whole, const Plan& plan,
                                              const MaterialMap& wood, const Discretisation& body) {
    const Layout& layout = body.layout;
    std::shared_ptr<LocalYield> made(new LocalYield);
    // Stations.
    const std::vector<Facet>& facets = body.facets;
    const double pitch = layout.cell.minCoeff() / finer;
    std::vector<int> held;
    for (int i = 0; i < static_cast<int>(facets.size()); ++i)
        if (where.contains(facets[i].position)) held.push_back(i);
    if (held.empty()) return nullptr;
    made->first_ = held.front();
    made->places_.assign(held.back() - held.front() + 1, {-1, 0.0});
    Box around{facets[held.front()].position, facets[held.front()].position};
    int stations = 0;
    for (std::size_t from = 0, to = 0; from < held.size(); from = to) {
        double length = facets[held[from]].length;
        const auto goes_on = [&](std::size_t k) {
            const Facet &a = facets[held[k - 1]], &b = facets[held[k]];
            return held[k] == held[k - 1] + 1 && (b.position - a.position).norm() < a.length + b.length;
        };
        for (to = from + 1; to < held.size() && goes_on(to); ++to) length += facets[held[to]].length;
        const int parts = std::max(1, static_cast<int>(std::lround(length / pitch)));
        double way = 0.0;
        for (std::size_t k = from; k < to; ++k) {
            const Facet& f = facets[held[k]];
            const double at = (way + 0.5 * f.length) / length * parts;
            way += f.length;
            const int before = std::min(static_cast<int>(at), parts - 1);
            made->places_[held[k] - made->first_] = {stations + before, at - before};
            around = {around.low.cwiseMin(f.position), around.high.cwiseMax(f.position)};
        }
        stations += parts + 1;
    }
    // The box, along the grid's lines.
    const Vec2 cells(layout.cells_x, layout.cells_y);
    const Vec2 low = (around.low.cwiseQuotient(layout.cell).array() - margin).floor().max(0.0);
    const Vec2 high = (around.high.cwiseQuotient(layout.cell).array() + margin).ceil().min(cells.array());
    const Box box{low.cwiseProduct(layout.cell), high.cwiseProduct(layout.cell)};
    const double cell = std::sqrt(layout.cell.prod());
    made->coarse_ = std::make_shared<Solved>(whole, plan, wood, box, cell);
    made->fine_ = std::make_shared<Solved>(whole, plan, wood, box, cell / finer);
    if (!made->coarse_->equilibrium || !made->fine_->equilibrium) return nullptr;

    // Loads: each facet's share of a station, held by the grid as the wheel's facets are, and on fine cells alone.
    std::vector<double> shares(stations, 0.0);
    for (const int i : held) {
        const Place& place = made->place(i);
        shares[place.station] += (1.0 - place.share) * facets[i].length;
        shares[place.station + 1] += place.share * facets[i].length;
    }
    for (const auto& side : {made->coarse_, made->fine_})
        side->loads.assign(stations, std::vector<Vec2>(side->equilibrium->displacements().size(), Vec2::Zero()));
    const Discretisation& fine = made->fine_->body;
    for (const int i : held) {
        const Place& place = made->place(i);
        const Facet& facet = facets[i];
        const Vec2 x = facet.position - box.low;
        const auto nearest = std::min_element(fine.facets.begin(), fine.facets.end(), [&](const Facet& a, const Facet& b) {
            return (a.position - x).squaredNorm() < (b.position - x).squaredNorm();
        });
        const int fine_cell = fine.points.cell[nearest->point];
        const auto fine_weight = fine.values_at(fine_cell, x);
        for (const int next : {0, 1}) {
            const int station = place.station + next;
            const double share = (next ? place.share : 1.0 - place.share) * facet.length;
            if (share == 0.0) continue;
            const Vec2 force = share / shares[station] * facet.normal;
            for (const SlidingBody::Hold& hold : rigid.holds(i)) {
                const int c = body.points.cell[hold.point];
                const Layout& part = made->coarse_->body.layout;
                const int inner = part.cell_index(c % layout.cells_x - static_cast<int>(low.x()),
                                                  c / layout.cells_x - static_cast<int>(low.y()));
                const auto nodes = part.cell_nodes(inner);
                for (int k = 0; k < 4; ++k) made->coarse_->loads[station][nodes[k]] += hold.weight[k] * force;
            }
            const auto nodes = fine.layout.cell_nodes(fine_cell);
            for (int k = 0; k < 4; ++k) made->fine_->loads[station][nodes[k]] += fine_weight[k] * force;
        }
    }
    if (!made->coarse_->solve() || !made->fine_->solve()) return nullptr;
    made->yield_ = made->fine_->product(made->fine_->loads) - made->coarse_->product(made->coarse_->loads);
    made->yield_ = (0.5 * (made->yield_ + made->yield_.transpose())).eval();
    return made;
}

void LocalYield::find_slopes(const std::vector<MaterialSlope>& numbers) {
    if (slopes_.size() == numbers.size()) return;
    slopes_.assign(numbers.size(), Eigen::MatrixXd::Zero(stations(), stations()));
    for (const auto& [side, sign] : {std::pair{fine_, -1.0}, {coarse_, 1.0}}) {
        side->numbers.clear();
        for (const MaterialSlope& number : numbers) side->numbers.emplace_back(number, side->body, side->box.low);
        std::vector<std::vector<std::vector<Vec2>>> pull(numbers.size());  // [numbers][stations][nodes]
        for (const auto& state : side->states) {
            side->equilibrium->set_displacements(state, 0.0);
            const Equilibrium::Slopes slopes = side->equilibrium->slopes(side->numbers);
            for (std::size_t n = 0; n < numbers.size(); ++n) {
                pull[n].emplace_back(state.size());
                for (std::size_t f = 0; f < state.size(); ++f) pull[n].back()[f] = slopes.fields.col(n).segment<2>(2 * f);
            }
        }
        for (std::size_t n = 0; n < numbers.size(); ++n) slopes_[n] += sign * side->product(pull[n]);
    }
}

// The yield s = A P^T N takes N^T P A P^T N / 2; with forces N(d - P s, p) and K = N' the slopes are
// ds = (1 + A P^T K P)^-1 (A' P^T N + A P^T N_p) and dN = N_p - K P ds. That of the energy with s as it is: -N^T P A' P^T N / 2.
LocalYield::Slope LocalYield::slope(const std::vector<SlidingBody::Touch>& touches, Eigen::VectorXd forces,
                                    const std::vector<MaterialSlope>& numbers, std::size_t number) {
    find_slopes(numbers);
    Eigen::VectorXd force = Eigen::VectorXd::Zero(stations()), direct = force;
    Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(stations(), stations());
    const auto for_shares = [&](const SlidingBody::Touch& touch, const auto& visit) {
        if (!holds(touch.facet)) return;
        visit(place(touch.facet).station, 1.0 - place(touch.facet).share);
        visit(place(touch.facet).station + 1, place(touch.facet).share);
    };
    for (std::size_t k = 0; k < touches.size(); ++k)
        for_shares(touches[k], [&](int a, double share) {
            force[a] += share * touches[k].force;
            direct[a] += share * forces[k];
            for_shares(touches[k], [&](int b, double other) { stiffness(a, b) += share * other * touches[k].stiffness; });
        });
    const Eigen::VectorXd given = slopes_[number] * force;
    const Eigen::MatrixXd system = Eigen::MatrixXd::Identity(stations(), stations()) + yield_ * stiffness;
    const Eigen::VectorXd sinks = system.partialPivLu().solve(given + yield_ * direct);
    for (std::size_t k = 0; k < touches.size(); ++k)
        for_shares(touches[k], [&](int a, double share) { forces[k] -= touches[k].stiffness * share * sinks[a]; });
    return {-0.5 * force.dot(given), std::move(forces)};
}

}  // namespace crampfit
