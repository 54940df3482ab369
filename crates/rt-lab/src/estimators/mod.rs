//! Estimators that are only tried: what they win is less than what they cost (docs/results/estimation.md).
//!
//! | estimator | source | what it asks of the devices |
//! |---|---|---|
//! | `adaptive` | J. Neyman (1934) | exact counts where they are least certain, as many as they are worth |
//! | `field` | small area estimation | exact counts of a sample, and what they and earlier ones say of the scene |

mod adaptive;
mod cells;
mod field;
mod growing;
#[cfg(test)]
mod tests;

use adaptive::Adaptive;
use field::Field;
use rt_balance::catalogue::{self, Entry, Make};
use rt_sched::sample::Fraction;
use std::sync::LazyLock;

/// Those of this module.
const TRIED: [Entry<Make>; 2] = [
    Entry {
        name: "adaptive",
        what: "As exact, with as many samples as they are worth, where they are worth most; only tried",
        make: Make::Beginning(|fraction| Box::new(Adaptive::new(fraction)), Fraction::TWO_HUNDRED_FIFTY_SIXTH),
    },
    Entry {
        name: "field",
        what: "As exact, with a map of where in the scene rays are expensive; only tried",
        make: Make::Sampling(|fraction| Box::new(Field::new(fraction)), Fraction::SIXTY_FOURTH),
    },
];

/// Every estimator: those of the catalogue, the default one first, and those that are only tried.
#[must_use]
pub fn all() -> &'static [Entry<Make>] {
    static ALL: LazyLock<Vec<Entry<Make>>> =
        LazyLock::new(|| catalogue::ESTIMATORS.iter().copied().chain(TRIED).collect());
    &ALL
}
