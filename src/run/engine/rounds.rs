//! Rounds of a pass that is repeated until it has settled. In the first round all places (tiles) run. In a
//! later round, only places that see a changed border run, or all places if the reduction asks for another
//! round. The result of a place is a pure function of the place and of the borders of its neighbours in the
//! previous round. A place that sees no change would compute the same result again, so its last result is
//! kept.

/// Which places run in which round, and where the latest result of each place is.
#[derive(Debug, Clone)]
pub(crate) struct Rounds {
    round: u32,
    /// Places that run in this round, ascending.
    due: Vec<usize>,
    /// Round and unit of the latest result of each place.
    latest: Vec<(u32, usize)>,
    /// Digest of the latest border of each place.
    borders: Vec<u64>,
}

impl Rounds {
    /// The first round over `places` places. `no_border` is the digest of an empty border, which all of them
    /// see.
    pub(crate) fn new(places: usize, no_border: u64) -> Self {
        Self {
            round: 0,
            due: (0..places).collect(),
            latest: vec![(0, 0); places],
            borders: vec![no_border; places],
        }
    }

    /// Number of this round, from 0.
    pub(crate) fn round(&self) -> u32 {
        self.round
    }

    /// Places that run in this round, ascending: unit n of the pass is the n-th of them.
    pub(crate) fn due(&self) -> &[usize] {
        &self.due
    }

    /// Round and unit of the latest result of a place, from the complete rounds.
    pub(crate) fn latest(&self, place: usize) -> (u32, usize) {
        self.latest[place]
    }

    /// Takes the digests of the borders of this round, by unit, and returns the places that see a change.
    /// `sees` gives the places that see the border of a place.
    pub(crate) fn complete(
        &mut self,
        borders: &[u64],
        mut sees: impl FnMut(usize) -> Vec<usize>,
    ) -> Vec<usize> {
        let mut next = Vec::new();
        for (unit, (&place, &border)) in self.due.iter().zip(borders).enumerate() {
            self.latest[place] = (self.round, unit);
            if std::mem::replace(&mut self.borders[place], border) != border {
                next.extend(sees(place));
            }
        }
        next.sort_unstable();
        next.dedup();
        next
    }

    /// Starts another round of these places.
    pub(crate) fn next(&mut self, due: Vec<usize>) {
        self.round += 1;
        self.due = due;
    }

    /// Starts another round of all places.
    pub(crate) fn again(&mut self) {
        self.next((0..self.latest.len()).collect());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_places_that_see_a_change_run_again() {
        // Four places in a row; each sees the next ones. The border of place 0 spreads to the right.
        let sees = |place: usize| {
            [place.checked_sub(1), (place < 3).then_some(place + 1)].into_iter().flatten().collect()
        };
        let mut rounds = Rounds::new(4, 0);
        assert_eq!(rounds.due(), [0, 1, 2, 3]);
        let due = rounds.complete(&[7, 0, 0, 0], sees);
        assert_eq!(due, [1]);
        rounds.next(due);
        let due = rounds.complete(&[7], sees);
        assert_eq!(due, [0, 2]);
        rounds.next(due);
        let due = rounds.complete(&[7, 0], sees);
        assert_eq!((due, rounds.round()), (vec![], 2));
        assert_eq!([0, 1, 2, 3].map(|place| rounds.latest(place)), [(2, 0), (1, 0), (2, 1), (0, 3)]);
        rounds.again();
        assert_eq!((rounds.round(), rounds.due()), (3, &[0, 1, 2, 3][..]));
    }
}
