#include "forward/face_normals.hpp"

#include <algorithm>

namespace crampfit {

void FaceNormals::take_in(const Discretisation& body, const CrackFields& cracks, bool rotates) {
    undeformed_.clear();
    for (const FieldPair& pair : cracks.pairs) undeformed_.push_back(pair.normal);
    turned_ = undeformed_;
    shares_.clear();
    first_share_.clear();
    if (!rotates) return;
    const Points& points = body.points;
    for (const FieldPair& pair : cracks.pairs) {
        first_share_.push_back(shares_.size());
        double sum = 0.0;
        body.for_cells_in(body.layout.support(pair.node), [&](int c) {
            for (int p = points.first_of_cell[c]; p < points.first_of_cell[c + 1]; ++p) {
                const CellWeights& w = body.weights[points.slot[p]];
                const auto fields = points.node[p];
                double weight = 0.0;
                for (std::size_t k = 0; k < fields.size(); ++k)
                    if (fields[k] == pair.left || fields[k] == pair.right) weight = points.volume[p] * w.value[k];
                if (weight == 0.0) continue;
                sum += weight;
                for (std::size_t k = 0; k < fields.size(); ++k) {
                    const Vec2 slope = weight * Vec2(w.slope_x[k], w.slope_y[k]);
                    const auto same = std::find_if(shares_.begin() + static_cast<std::ptrdiff_t>(first_share_.back()),
                                                   shares_.end(), [&](const Share& share) { return share.field == fields[k]; });
                    if (same == shares_.end()) shares_.push_back({fields[k], slope});
                    else same->slope += slope;
                }
            }
        });
        for (std::size_t i = first_share_.back(); i < shares_.size(); ++i) shares_[i].slope /= sum;
    }
    first_share_.push_back(shares_.size());
}

std::span<const FaceNormals::Share> FaceNormals::shares(std::size_t pair) const {
    if (!can_turn()) return {};
    return {shares_.begin() + static_cast<std::ptrdiff_t>(first_share_[pair]), first_share_[pair + 1] - first_share_[pair]};
}

Polar FaceNormals::polar(std::size_t pair, const std::vector<Vec2>& displacement) const {
    Mat2 gradient = Mat2::Zero();
    for (const Share& share : shares(pair)) gradient += displacement[share.field] * share.slope.transpose();
    return Polar(gradient);
}

void FaceNormals::turn(const std::vector<Vec2>& displacement) {
    for (std::size_t k = 0; k + 1 < first_share_.size(); ++k) turned_[k] = polar(k, displacement).turn * undeformed_[k];
}

}  // namespace crampfit
