#include "forward/local_yield.hpp"

#include "forward/cut_out.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SparseCore>

#include <algorithm>
#include <cmath>

namespace crampfit {

namespace {

constexpr double margin = 6.0;  // of the box about the facets, in cells

Plan of_box(Plan plan) {
    plan.rotates = plan.friction = plan.contact = plan.remembers = plan.free_bodies = plan.finer_at_wheels = false;
    plan.linear = true;
    return plan;
}

}  // namespace

// The box on one grid.
struct LocalYield::Solved {
    Solved(const Scene& whole, const Plan& plan, const MaterialMap& wood, const Box& box, const Vec2& cell)
        : cut(whole, wood, box, cell), small(of_box(plan)) {
        if (!cut.scene.edges.empty()) equilibrium.emplace(cut.scene, small, cut.materials, cut.body);
    }

    int fields() const { return equilibrium->cracks().fields(); }
    bool solve() { return equilibrium->relax(std::vector<Vec2>(fields(), Vec2::Zero())); }

    Eigen::MatrixXd compliance() const { return equilibrium->compliance(loads); }

    // Slope of the compliance by the numbers: -U^T K' U, where U are the displacements of unit forces.
    void add_slopes(const std::vector<MaterialSlope>& numbers, double sign, std::vector<Eigen::MatrixXd>& by_number) {
        const std::vector<MaterialSlope>& here = cut.slopes_by(numbers);
        Eigen::MatrixXd states(loads.rows(), loads.cols());
        constexpr Eigen::Index together = 16;  // stations
        const auto for_some = [&](const auto& visit) {
            for (Eigen::Index first = 0; first < states.cols(); first += together)
                visit(first, std::min(together, states.cols() - first));
        };
        for_some([&](Eigen::Index first, Eigen::Index count) {
            states.middleCols(first, count) = equilibrium->yields_to(loads.middleCols(first, count));
        });
        for_some([&](Eigen::Index first, Eigen::Index count) {
            std::vector<Eigen::MatrixXd> pulls(here.size(), Eigen::MatrixXd(states.rows(), count));
            for (Eigen::Index k = 0; k < count; ++k) {
                std::vector<Vec2> displacement(fields());
                for (int f = 0; f < fields(); ++f) displacement[f] = states.col(first + k).segment<2>(2 * f);
                equilibrium->set_displacements(displacement, 0.0);
                const Eigen::MatrixXd of_station = equilibrium->slopes(here).fields;
                for (std::size_t n = 0; n < here.size(); ++n) pulls[n].col(k) = of_station.col(n);
            }
            for (std::size_t n = 0; n < here.size(); ++n)
                by_number[n].middleCols(first, count) -= sign * (states.transpose() * pulls[n]);
        });
    }

    CutOutWood cut;
    Plan small;
    std::optional<Equilibrium> equilibrium;  // none: nothing is held
    Eigen::SparseMatrix<double> loads;       // [2 x fields, stations] unit forces
};

// Gives the facets that are held, in order.
std::vector<int> LocalYield::place_stations(const Box& where, const std::vector<Facet>& facets, double pitch) {
    constexpr double hair = 1e-6;  // of a length: half a pitch over is half but for last digits of the specimen's size
    std::vector<int> held;
    for (int i = 0; i < static_cast<int>(facets.size()); ++i)
        if (where.contains(facets[i].position)) held.push_back(i);
    if (held.empty()) return held;
    first_ = held.front();
    places_.assign(held.back() - held.front() + 1, {-1, 0.0});
    for (std::size_t from = 0, to = 0; from < held.size(); from = to) {
        double length = facets[held[from]].length;
        const auto goes_on = [&](std::size_t k) {
            const Facet &a = facets[held[k - 1]], &b = facets[held[k]];
            return held[k] == held[k - 1] + 1 && (b.position - a.position).norm() < a.length + b.length;
        };
        for (to = from + 1; to < held.size() && goes_on(to); ++to) length += facets[held[to]].length;
        const int parts = std::max(1, static_cast<int>(std::lround((1.0 + hair) * length / pitch)));
        double way = 0.0;
        for (std::size_t k = from; k < to; ++k) {
            const Facet& f = facets[held[k]];
            const double at = (way + 0.5 * f.length) / length * parts;
            way += f.length;
            const int before = std::min(static_cast<int>(at), parts - 1);
            places_[held[k] - first_] = {stations_ + before, at - before};
        }
        stations_ += parts + 1;
    }
    return held;
}

// What the held facets bear of unit forces on the stations.
std::vector<LocalYield::Load> LocalYield::loads(const std::vector<int>& held, const std::vector<Facet>& facets) const {
    std::vector<double> lengths(stations_, 0.0);
    std::vector<Load> found;
    for (const int i : held)
        for (const int next : {0, 1}) {
            const double length = (next ? place(i).share : 1.0 - place(i).share) * facets[i].length;
            lengths[place(i).station + next] += length;
            if (length > 0.0) found.push_back({i, place(i).station + next, length * facets[i].normal});
        }
    for (Load& load : found) load.force /= lengths[load.station];
    return found;
}

std::shared_ptr<LocalYield> LocalYield::about(const Box& where, const SlidingBody& rigid, const Scene& whole, const Plan& plan,
                                              const MaterialMap& wood, const Discretisation& body) {
    const Layout& layout = body.layout;
    const std::vector<Facet>& facets = body.facets;
    std::shared_ptr<LocalYield> made(new LocalYield);
    const std::vector<int> held = made->place_stations(where, facets, layout.cell.minCoeff() / finer);
    if (held.empty()) return nullptr;
    // The box, along the grid's lines. Facets lie on these but for rounding.
    constexpr double hair = 1e-6;  // [cells]
    Box around{facets[held.front()].position, facets[held.front()].position};
    for (const int i : held) around = {around.low.cwiseMin(facets[i].position), around.high.cwiseMax(facets[i].position)};
    const Vec2 cells(layout.cells_x, layout.cells_y);
    const Vec2 low = (around.low.cwiseQuotient(layout.cell).array() - margin + hair).floor().max(0.0);
    const Vec2 high = (around.high.cwiseQuotient(layout.cell).array() + margin - hair).ceil().min(cells.array());
    const Box box{low.cwiseProduct(layout.cell), high.cwiseProduct(layout.cell)};
    made->coarse_ = std::make_shared<Solved>(whole, plan, wood, box, layout.cell);
    made->fine_ = std::make_shared<Solved>(whole, plan, wood, box, layout.cell / finer);
    if (!made->coarse_->equilibrium || !made->fine_->equilibrium) return nullptr;

    // Loads are held by the grid as the wheel's facets are, and on fine cells alone.
    const Discretisation &coarse = made->coarse_->cut.body, &fine = made->fine_->cut.body;
    std::vector<Eigen::Triplet<double>> on_coarse, on_fine;
    for (const Load& load : made->loads(held, facets)) {
        const auto add = [&](std::vector<Eigen::Triplet<double>>& loads, std::span<const int> fields, const auto& weight) {
            for (int k = 0; k < 4; ++k)
                for (const int axis : {0, 1})
                    loads.emplace_back(2 * fields[k] + axis, load.station, weight[k] * load.force[axis]);
        };
        for (const SlidingBody::Hold& hold : rigid.holds(load.facet)) {
            const int c = body.points.cell[hold.point];
            const int inner = coarse.layout.cell_index(c % layout.cells_x - static_cast<int>(low.x()),
                                                       c / layout.cells_x - static_cast<int>(low.y()));
            add(on_coarse, coarse.layout.cell_nodes(inner), hold.weight);
        }
        const Vec2 x = facets[load.facet].position - box.low;
        const auto distance = [&](const Facet& f) { return (f.position - x).squaredNorm(); };
        const int point = std::ranges::min_element(fine.facets, {}, distance)->point;
        add(on_fine, fine.points.node[point], fine.values_at(fine.points.cell[point], x));
    }
    for (const auto& [side, loads] : {std::pair{made->coarse_, &on_coarse}, {made->fine_, &on_fine}}) {
        side->loads.resize(2 * side->fields(), made->stations_);
        side->loads.setFromTriplets(loads->begin(), loads->end());
        if (!side->solve()) return nullptr;
    }
    const Eigen::MatrixXd more = made->fine_->compliance() - made->coarse_->compliance();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(more);
    made->modes_ = modes.eigenvectors();
    made->mode_yield_ = modes.eigenvalues();
    made->yield_ = made->modes_ * made->mode_yield_.cwiseMax(0.0).asDiagonal() * made->modes_.transpose();
    return made;
}

// A function f of a symmetric matrix A = V diag(a) V^T has the slope V (F o V^T A' V) V^T with F_ij = (f(a_i) - f(a_j)) / (a_i -
// a_j), or f'(a_i) (Daleckii and Krein 1965).
void LocalYield::know_slopes(const std::vector<MaterialSlope>& numbers) {
    if (slopes_.size() == numbers.size()) return;
    slopes_.assign(numbers.size(), Eigen::MatrixXd::Zero(stations_, stations_));
    fine_->add_slopes(numbers, 1.0, slopes_);
    coarse_->add_slopes(numbers, -1.0, slopes_);
    for (Eigen::MatrixXd& slope : slopes_) {
        slope = modes_.transpose() * slope * modes_;
        for (int i = 0; i < stations_; ++i)
            for (int j = 0; j < stations_; ++j) {
                const auto [low, high] = std::minmax(mode_yield_[i], mode_yield_[j]);
                slope(i, j) *= low > 0.0 ? 1.0 : high > 0.0 ? high / (high - low) : 0.0;
            }
        slope = modes_ * slope * modes_.transpose();
    }
    forget_slopes();
}

void LocalYield::forget_slopes() {
    coarse_.reset();
    fine_.reset();
}

// With s = A P^T N(d - P s) and K = N' the yields follow the depths d by (1 + A P^T K P)^-1 A P^T K.
LocalYield::Pressed LocalYield::pressed(const std::vector<SlidingBody::Touch>& touches) const {
    Pressed found;
    std::vector<int>& at = found.stations;
    for (const SlidingBody::Touch& touch : touches)
        if (holds(touch.facet)) at.insert(at.end(), {place(touch.facet).station, place(touch.facet).station + 1});
    std::ranges::sort(at);
    at.erase(std::ranges::unique(at).begin(), at.end());
    const auto count = static_cast<Eigen::Index>(at.size()), facets = static_cast<Eigen::Index>(touches.size());
    found.share = Eigen::MatrixXd::Zero(facets, count);
    found.stiffness.resize(facets);
    for (Eigen::Index k = 0; k < facets; ++k) {
        found.stiffness[k] = touches[k].stiffness;
        if (!holds(touches[k].facet)) continue;
        const Place& of_facet = place(touches[k].facet);
        const auto first = std::ranges::lower_bound(at, of_facet.station) - at.begin();
        found.share(k, first) = 1.0 - of_facet.share;
        found.share(k, first + 1) = of_facet.share;
    }
    const Eigen::MatrixXd yield = yield_(at, at);
    const Eigen::MatrixXd springs = found.share.transpose() * found.stiffness.asDiagonal() * found.share;
    found.gives = (Eigen::MatrixXd::Identity(count, count) + yield * springs).partialPivLu().solve(yield);
    found.gives = (0.5 * (found.gives + found.gives.transpose())).eval();
    return found;
}

// With forces N(d - P s, p) the slopes by p are ds = (1 + A P^T K P)^-1 (A' P^T N + A P^T N_p) and dN = N_p - K P ds. The yield
// takes N^T P A P^T N / 2; the slope of the energy with s as it is: -N^T P A' P^T N / 2.
LocalYield::Slope LocalYield::slope(const std::vector<SlidingBody::Touch>& touches, Eigen::VectorXd forces,
                                    const std::vector<MaterialSlope>& numbers, std::size_t number) {
    know_slopes(numbers);
    const Pressed at = pressed(touches);
    Eigen::VectorXd force(touches.size());
    for (std::size_t k = 0; k < touches.size(); ++k) force[k] = touches[k].force;
    const Eigen::VectorXd on_stations = at.share.transpose() * force;
    const Eigen::VectorXd given = slopes_[number](at.stations, at.stations) * on_stations;
    const Eigen::VectorXd sinks =
        given + at.gives * (at.share.transpose() * (forces - at.stiffness.cwiseProduct(at.share * given)));
    forces -= at.stiffness.cwiseProduct(at.share * sinks);
    return {-0.5 * on_stations.dot(given), std::move(forces)};
}

}  // namespace crampfit
