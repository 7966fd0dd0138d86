//! Loops over columns of numbers for the processor at hand. Everything else is plain Rust, which is compiled
//! twice so that it also uses the instructions of the processor.
//!
//! All processors give the same results: the operations and their order are the same, and IEEE 754 defines
//! each of them to the last bit.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod columns;

pub(crate) use columns::{Block, Boxes, Columns, Look};
pub(super) use columns::{EXACT, LANES, MOST};

/// The loops that are written for each kind of processor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loops<L, K> {
    /// [`columns::look`].
    pub(super) look: L,
    /// [`columns::keep`].
    pub(crate) keep: K,
}

/// Work that spends its time in loops over columns.
pub(crate) trait Work {
    /// Its result.
    type Output;

    /// Does the work. It must be inlined with `#[inline(always)]`; otherwise it is not compiled with the
    /// instructions of the processor.
    fn with<L, K>(self, loops: &Loops<L, K>) -> Self::Output
    where
        L: Fn(&[Block], &Boxes, Look, &mut Columns) -> usize,
        K: Fn(&mut Columns, f32);
}

/// Does the work with the instructions of the processor at hand.
pub(crate) fn run<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("popcnt") {
        #[expect(unsafe_code, reason = "what needs AVX2 can only be called by an unsafe call")]
        // SAFETY: the processor has AVX2 and POPCNT.
        return unsafe { with_avx2(work) };
    }
    work.with(&Loops { look: columns::look, keep: columns::keep })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,popcnt")]
fn with_avx2<W: Work>(work: W) -> W::Output {
    // A closure is compiled with the instructions of the surrounding function; a function passed as a value
    // is not.
    let look = |blocks: &[Block], boxes: &Boxes, look: Look, found: &mut Columns| {
        avx2::look(blocks, boxes, look, found)
    };
    let keep = |found: &mut Columns, limit: f32| avx2::keep(found, limit);
    work.with(&Loops { look, keep })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Numbers;

    /// Random blocks of a cube of 4,000 units, and places to look around.
    struct Scene {
        blocks: Vec<Block>,
        places: Vec<[i32; 3]>,
    }

    /// What is found: squared distances, coordinates and slots.
    type Found = Vec<(u32, [i32; 3], u32)>;

    fn scene() -> Scene {
        let mut numbers = Numbers::new(9);
        let mut below = |most: u64| i32::try_from(numbers.below(most)).unwrap();
        let mut block = || {
            let axes = std::array::from_fn(|_| std::array::from_fn(|_| below(4_000)));
            Block { axes, len: below(8).unsigned_abs() + 1 }
        };
        let blocks = (0..37).map(|_| block()).collect();
        Scene { blocks, places: (0..60).map(|_| std::array::from_fn(|_| below(4_000))).collect() }
    }

    fn points(found: &Columns) -> Found {
        let by = |at: usize| [0, 1, 2].map(|axis| found.by()[axis][at]);
        (0..found.len()).map(|at| (found.squared()[at].to_bits(), by(at), found.at()[at])).collect()
    }

    impl Work for &Scene {
        type Output = Vec<[Found; 2]>;

        #[inline(always)]
        fn with<L, K>(self, loops: &Loops<L, K>) -> Self::Output
        where
            L: Fn(&[Block], &Boxes, Look, &mut Columns) -> usize,
            K: Fn(&mut Columns, f32),
        {
            let origin = [700, 20, 3_000];
            let mut boxes = Boxes::default();
            for (number, block) in (0..).zip(&self.blocks) {
                let values = |axis: usize| block.axes[axis][..block.len as usize].iter().copied();
                let low = [0, 1, 2].map(|axis| values(axis).min().unwrap());
                boxes.push(number, low, [0, 1, 2].map(|axis| values(axis).max().unwrap()), origin);
            }
            boxes.end();
            let search = |place: &[i32; 3]| {
                let (limit, mut found) = (1_500_000.0, Columns::default());
                found.begin(limit);
                let mut first = 3;
                // With `most` 20, the search needs two parts: it stops when it has more than 20 points.
                for most in [20, 500] {
                    let look = Look { first, end: boxes.len() - 1, place: *place, origin, limit, most };
                    first = (loops.look)(&self.blocks, &boxes, look, &mut found);
                    assert!(first == boxes.len() - 1 || found.len() > most && found.len() <= most + LANES);
                }
                let all = points(&found);
                (loops.keep)(&mut found, 700_000.0);
                [all, points(&found)]
            };
            self.places.iter().map(search).collect()
        }
    }

    #[test]
    fn loops_find_the_points_within_a_limit_on_every_processor() {
        let scene = scene();
        let found = run(&scene);
        assert_eq!(found, scene.with(&Loops { look: columns::look, keep: columns::keep }));
        for (place, found) in scene.places.iter().zip(found) {
            for (limit, found) in [1_500_000, 700_000].into_iter().zip(found) {
                let mut expected = Vec::new();
                for (number, block) in scene.blocks.iter().enumerate().take(36).skip(3) {
                    for lane in 0..block.len as usize {
                        let by = [0, 1, 2].map(|axis| block.axes[axis][lane] - place[axis]);
                        let squared: i32 = by.iter().map(|by| by * by).sum();
                        if squared <= limit {
                            let slot = u32::try_from(number * LANES + lane).unwrap();
                            expected.push(((squared as f32).to_bits(), by, slot));
                        }
                    }
                }
                assert_eq!(found, expected);
            }
        }
    }

    #[test]
    fn the_nearest_are_separated_also_from_equally_near_ones() {
        let mut found = Columns::default();
        found.begin(40.0);
        let far = 30_000;
        // The last two are 1,800,000,000 and one more, which are equal in single precision.
        for (slot, by) in
            (0..).zip([[3, 0, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1], [far, far, 0], [far, far, 1]])
        {
            let squared: i32 = by.iter().map(|by| by * by).sum();
            found.push(squared as f32, by, slot);
        }
        let number = [9, 8, 5, 6, 2, 1];
        for (count, nearest) in [
            (1, vec![2]),
            (2, vec![2, 3]),
            (3, vec![1, 2, 3]),
            (4, vec![0, 1, 2, 3]),
            (5, vec![0, 1, 2, 3, 4]),
        ] {
            let mut found = found.clone();
            let limit = found.separate(count, &number);
            columns::keep(&mut found, limit);
            assert_eq!(found.at(), nearest, "{count}");
        }
    }
}
