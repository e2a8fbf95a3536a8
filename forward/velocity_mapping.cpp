#include "forward/velocity_mapping.hpp"

#include "forward/deformation.hpp"

namespace crampfit {

double VelocityMapping::kinetic_energy(const std::vector<Vec2>& w, Team& team) {
    const Points& points = body_.points;
    energy_.resize(strips_.count());
    strips_.each(team, [&](int strip) {
        double sum = 0.0;
        for (int p = points.first_of_cell[strips_.first_cell(strip)]; p < points.first_of_cell[strips_.first_cell(strip + 1)];
             ++p)
            sum += 0.5 * points.mass[p] * value_at(body_, p, w).squaredNorm();
        energy_[strip] = sum;
    });
    double sum = 0.0;
    for (const double energy : energy_) sum += energy;
    return sum;
}

void VelocityMapping::hand_back(std::vector<Vec2>& v, const Nodes& nodes) {
    const Points& points = body_.points;
    from_points_.assign(v.size(), Vec2::Zero());
    strips_.each(nodes.team, [&](int strip) {
        for (int p = points.first_of_cell[strips_.first_cell(strip)]; p < points.first_of_cell[strips_.first_cell(strip + 1)];
             ++p) {
            const Vec2 momentum = points.mass[p] * value_at(body_, p, v);
            const CellWeights& weights = body_.weights[points.slot[p]];
            const auto node = points.node[p];
            for (std::size_t k = 0; k < node.size(); ++k) from_points_[node[k]] += weights.value[k] * momentum;
        }
    });
    nodes.team.pieces(static_cast<int>(v.size()), [&](int first, int last) {
        for (int n = first; n < last; ++n)
            for (int axis = 0; axis < 2; ++axis)
                if (nodes.mass[n] > 0.0 && !(nodes.held[n] >> axis & 1)) v[n][axis] = from_points_[n][axis] / nodes.mass[n];
    });
}

void VelocityMapping::take_out(std::vector<Vec2>& v, const Nodes& nodes) {
    term_ = v;
    hand_back(v, nodes);
    for (std::size_t n = 0; n < v.size(); ++n) v[n] = term_[n] - v[n];
}

double VelocityMapping::extrapolate(std::vector<Vec2>& velocity, const std::vector<Vec2>& acceleration, double dt,
                                    const Nodes& nodes) {
    const int order = choice_.velocity_update == VelocityUpdate::pic ? 1 : choice_.order;
    const std::size_t fields = velocity.size();
    const auto for_free = [&](const auto& visit) {  // what is prescribed has no acceleration yet
        for (std::size_t n = 0; n < fields; ++n)
            for (int axis = 0; axis < 2; ++axis)
                if (!(nodes.held[n] >> axis & 1)) visit(n, axis);
    };
    sum_.resize(fields);
    for (std::size_t n = 0; n < fields; ++n) sum_[n] = velocity[n] - dt * acceleration[n];
    const double before = kinetic_energy(sum_, nodes.team);
    double work = 0.0;
    for_free([&](std::size_t n, int axis) { work += 0.5 * dt * nodes.mass[n] * acceleration[n][axis] * sum_[n][axis]; });

    hand_back(sum_, nodes);
    for_free([&](std::size_t n, int axis) { sum_[n][axis] += dt * acceleration[n][axis]; });
    extrapolated_ = sum_;
    for (int k = 1; k < order; ++k) {
        take_out(sum_, nodes);
        for (std::size_t n = 0; n < fields; ++n) extrapolated_[n] += sum_[n];
    }
    for_free([&](std::size_t n, int axis) {
        velocity[n][axis] = extrapolated_[n][axis];
        work += 0.5 * dt * nodes.mass[n] * acceleration[n][axis] * velocity[n][axis];
    });
    return before + work - kinetic_energy(extrapolated_, nodes.team);
}

double VelocityMapping::carry(std::vector<Vec2>& w, std::vector<Vec2>& velocity, const std::vector<Vec2>& acceleration, double dt,
                              const Nodes& nodes) {
    const std::size_t fields = w.size();
    const double share = choice_.velocity_update == VelocityUpdate::flip ? choice_.pic_share : 0.0;
    const bool filters = choice_.velocity_update == VelocityUpdate::xpic || share > 0.0;
    if (filters) {  // (1 - A)^m w of XPIC; a share of (1 - A) w of FLIP
        sum_.resize(fields);
        for (std::size_t n = 0; n < fields; ++n) sum_[n] = w[n] - (velocity[n] - dt * acceleration[n]);
        for (int k = 1; k < choice_.order && share == 0.0; ++k) take_out(sum_, nodes);
    }
    for (std::size_t n = 0; n < fields; ++n) {
        w[n] += dt * acceleration[n];
        for (int axis = 0; axis < 2; ++axis)
            if (nodes.held[n] >> axis & 1) w[n][axis] = velocity[n][axis];
    }
    double lost = 0.0;
    if (filters) {
        lost = kinetic_energy(w, nodes.team);
        for (std::size_t n = 0; n < fields; ++n) w[n] -= (share > 0.0 ? share : 1.0) * sum_[n];
        lost -= kinetic_energy(w, nodes.team);
    }
    velocity = w;
    hand_back(velocity, nodes);
    return lost;
}

}  // namespace crampfit
