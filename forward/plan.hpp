#pragma once

#include "forward/discretisation.hpp"

#include <string>
#include <vector>

namespace crampfit {

/// What this scene needs, decided once. Nothing that it leaves out is allocated or looped over.
struct Plan {
    bool quasistatic = false;            // equilibrium; else explicit dynamics
    bool linear = false;                 // equilibrium goes linearly with the load
    bool extrapolates = false;           // a second grid, twice as coarse, tells and takes off most of the grid's error
    bool driven = false;                 // some edge or body moves
    double still_from = 0;               // when everything that moves has come to its end [s]; infinite: never
    bool rotates = false;                // finite rotation; else small strain
    bool may_turn = false;               // small strain, and nothing tells beforehand that it is enough
    bool cuts_domains = false;           // at equilibrium straight cracks cut points' domains; else points lie on one side
    bool grows = false;                  // some tip may grow
    bool contact = false;                // some body can touch and slide
    bool friction = false;               // some body or closed crack faces rub: a state hangs on the way to it
    bool remembers = false;              // some wood is viscoelastic or plastic: a state hangs on the way to it
    bool free_bodies = false;            // some body follows a force
    bool finer_at_wheels = false;        // at equilibrium wheels feel wood on finer cells than the grid's
    double time_step = 0;                // [s]
    double added_frequency_squared = 0;  // what contact and ties may add to the highest squared frequency [1/s^2]
    double end_time = 0;                 // when a stop condition on time or displacement is met [s]; infinite: none is
    double slowness = 0;                 // transits of the specimen by a wave while the load is applied

    struct Choice {
        std::string part;
        std::string choice;
        std::string reason;
        bool warns = false;  // also at the end of a run: hardly what the scene meant
    };
    std::vector<Choice> choices;  // for `crampfit explain`
};

/// Checks that a solver here can do what is asked, and decides. Throws InputError naming the key that it cannot honour.
Plan make_plan(const Scene& scene, const MaterialMap& materials, const Discretisation& body);

/// How many crack tips may grow.
int growing_tips(const Scene& scene);

std::string describe(const Scene& scene, const Plan& plan, const Discretisation& body);

}  // namespace crampfit
