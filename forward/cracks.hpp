#pragma once

#include "forward/discretisation.hpp"

#include <map>
#include <optional>
#include <vector>

namespace crampfit {

/// One end of a crack.
struct CrackTip {
    bool grows = false;
    bool inside = false;  // the tip lies in the material; a crack that starts on a side, or on another crack, has one tip only
    Vec2 position;        // undeformed [m]
    Vec2 direction;       // unit, ahead
    int wall = -1;        // another crack into whose face this one has run: wood beyond it does not feel this crack
    bool wall_on_left = false;  // of the wall, seen from its start: the side where this crack lies
};

/// A crack as a line in the undeformed specimen, from its `start` to its `end`.
struct CrackLine {
    std::vector<Vec2> points;  // [m]
    CrackTip start;
    CrackTip end;
    double length = 0.0;  // of the part inside the specimen's rectangle [m]

    CrackTip& tip(bool at_end) { return at_end ? end : start; }
    const CrackTip& tip(bool at_end) const { return at_end ? end : start; }

    /// The place a distance behind a tip along the crack [m]; the far end when the crack is shorter.
    Vec2 behind(bool at_end, double distance) const;
    /// Unit direction of the crack, seen toward a tip, at the place of the crack that is nearest to x.
    Vec2 direction_near(bool at_end, const Vec2& x) const;
    /// Whether the bounds of one of its straight pieces touch a box.
    bool comes_to(const Box& box) const;
};

/// Two fields of one node, on either side of a crack.
struct FieldPair {
    int left;       // field on the left of the crack, seen from start to end
    int right;      // field on the right
    int with_node;  // that of the two whose wood lies on the node's side of the crack
    int node;       // where they are
    int crack;
    Vec2 normal;           // unit, from right to left
    Vec2 freed_at;         // where the tip is when it frees the pair
    Vec2 along;            // unit, the way that it goes
    double plane_modulus;  // E' of the wood there [Pa]
    double compliance;     // of the pair when it is free [m/N]
    double freed;          // share of the way past the pair that the tip has gone; 1: the crack has cut the node's whole support
    double tie;            // stiffness that still holds the pair together [N/m]; 0 once the pair is free
    int like;              // an earlier pair of this crack at the node, that another crack has split; -1: none
};

/// Share of its way past a node that a tip has gone: below 0 before, above 1 after. Along the grid, and at up to 27 degrees to
/// it, a tip passes all nodes of a column of the grid, or of a row, in half a cell before and behind the place where it crosses
/// it. So one column follows another, and as much energy is given up on all of the way. At 35 to 55 degrees, where it goes
/// through as many rows as columns, nodes are passed by their places along the crack. In between the two go over into one
/// another.
double share_freed(const Vec2& node, const CrackTip& tip, const Layout& layout);

/// The length of that way [m].
double way_past_a_node(const Vec2& direction, const Vec2& cell);

/// At equilibrium a pair of fields appears as soon as the tip has gone this part of a cell. Its tie is then that much stiffer
/// than the wood: with less, it would spoil the condition of the stiffness; with more, the energy would go in steps.
inline constexpr double least_freed_at_rest = 0.02;

/// The part of a tie that a pair of fields with these masses on its left and right takes. A crack between two rows of nodes has a
/// pair on either: they share the tie as they share the mass beyond the crack.
double tie_share(double left, double right);

/// What still holds the pair of fields at a node together when so much of it is freed [N/m]; `stiffness`: E' of the wood times
/// the thickness [N/m].
double tie_stiffness(double freed, double stiffness);

/// E' of the wood of a small area as a crack that runs along a direction sees it, G = K_I^2 / E' [Pa].
double opening_modulus(const MaterialMap& materials, const Vec2& centre, const Vec2& half, const Vec2& along);

/// Which velocity field of a node a point belongs to (CRAMP; Nairn 2003): points that a crack separates from a node move with
/// another field of that node. Fields are numbered: the nodes first, then further fields as cracks call for them.
///
/// A crack tip lies anywhere in a cell, but a pair of fields is either there or not, which alone would move the tip in steps of
/// a cell. So a pair is tied by springs while the tip passes its node, over the width of a cell, and the spring yields such
/// that the energy released goes linearly with the tip: with c the compliance of the pair and f the part of the way that the
/// tip has gone, the energy released is 1/2 F^2 c / (1 + s c), which is f times that of the free pair when s = (1 - f) / (f c).
class CrackFields {
  public:
    /// A pair appears once the tip has gone `least_freed` of that way, or just before for a negative number. `tie` never
    /// becomes stiffer than it is at that share, if that is above 0.
    /// With `cuts_domains` the points' domains are cut as cracks go that are alone where they are (`Sliver`).
    CrackFields(const Scene& scene, Discretisation& body, const MaterialMap& materials, double least_freed,
                bool cuts_domains = false);

    struct NewField {
        int field;
        int from;  // the field whose motion it starts with
    };

    struct Move {
        int point, corner;  // of its cell
        int from, to;       // fields
    };

    std::vector<CrackLine> lines;
    std::vector<FieldPair> pairs;
    std::vector<Move> moves;         // of points from field to field when a crack grew last
    std::vector<int> node_of_field;  // [fields] the node where each field is

    int fields() const { return static_cast<int>(node_of_field.size()); }

    /// Moves a tip of a crack straight to a new place; the points and pairs near it follow. Where it meets another crack on the
    /// way, or comes so near that the grid does not tell, it ends there. Returns the fields that this adds.
    std::vector<NewField> grow(int crack, bool at_end, const Vec2& to);

    /// The same where the tip goes straight on and frees no further node, so that no point changes sides. False, and nothing is
    /// done, where it does not.
    bool slide(int crack, bool at_end, double distance);

    /// Where points change sides when a tip goes from one place to another.
    Box window(const Vec2& from, const Vec2& to) const;

    /// The fields at the nodes that a cell sees with which the material at x, in it or beside it, moves: the first
    /// `nodes_per_cell()` of these.
    std::array<int, most_nodes> fields_at(int cell, const Vec2& x) const;

    /// Of the material at x, from the fields' displacements [m].
    Vec2 displacement_at(const Vec2& x, const std::vector<Vec2>& displacement) const;

    /// On which side of a crack x lies, seen from start to end; its ends go on straight.
    bool is_left(int crack, const Vec2& x) const;

    /// Displacement jump (left minus right) across a crack at a place on it, from the fields' displacements [m].
    Vec2 opening(int crack, const Vec2& x, const std::vector<Vec2>& displacement) const;

  private:
    struct Meeting {
        Vec2 at;  // [m]
        int crack;
    };
    std::optional<Meeting> meeting(int crack, const Vec2& from, const Vec2& to, double near) const;
    void end_at(CrackTip& tip, const Meeting& there);
    bool wood_lies_ahead(const CrackTip& tip, double distance) const;
    bool beyond_wall(int crack, const Vec2& x) const;
    double freed(int crack, int node) const;
    bool is_inside(const Vec2& x) const;
    void sort_points(int crack, const Box& window);
    void cut_domains(const Box& window);
    std::array<Vec2, 2> stretched(int crack, std::size_t piece) const;
    bool goes_to(int crack, const Box& box) const;
    int only_crack_at(int cell) const;
    bool lies_at_a_kink(int crack, const Vec2& x) const;
    std::optional<Sliver> cut_off(int crack, int point, const std::vector<unsigned>& parted);
    int field(int node, unsigned mask, int crack);
    void add_pairs(int node, unsigned mask);
    void renew_sides(int crack);
    void renew_ties(int crack);
    void set_tie(FieldPair& pair) const;

    const Scene* scene_;
    Discretisation* body_;
    const MaterialMap* materials_;
    double least_freed_;
    bool cuts_domains_;
    PointTable<std::uint8_t> mask_;                     // [points] bit k: crack k lies between the point and the cell's node
    std::map<std::pair<int, unsigned>, int> field_of_;  // node and mask to field, for masks above 0
    std::vector<NewField> new_fields_;
};

}  // namespace crampfit
