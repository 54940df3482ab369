//! Graphics cards to test.

use rt_gpu::Card;

/// Whether each card is the software of one before it once more: `setup` lists a software driver several times to make
/// several devices, and what the first does the others do. Real cards are no copies of each other.
#[must_use]
pub fn are_copies(cards: &[&Card]) -> Vec<bool> {
    let same = |a: &Card, b: &Card| a.software && b.software && (&a.name, &a.driver) == (&b.name, &b.driver);
    let is_copy = |(place, card): (usize, &&Card)| cards[..place].iter().any(|before| same(before, card));
    cards.iter().enumerate().map(is_copy).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: real cards taken for copies; another driver's software left out.
    #[test]
    fn only_software_comes_twice() {
        let card = |name: &str, driver: &str, software| Card {
            name: name.to_owned(),
            driver: driver.to_owned(),
            software,
            model: [0; 2],
            slot: None,
            binding: 0,
            kernels: "",
        };
        let cards = [
            card("llvmpipe", "25", true),
            card("H200", "1", false),
            card("llvmpipe", "25", true),
            card("llvmpipe", "26", true),
            card("H200", "1", false),
        ];
        let found = are_copies(&cards.iter().collect::<Vec<_>>());
        assert_eq!(found, [false, false, true, false, false]);
    }
}
