//! Copies of sample objects whose voxels are classified worse than on synthetic drives.
//!
//! The models of voxels learned from synthetic drives, and classify such drives well. So a model of names
//! that learned from synthetic drives alone believes the shares of the voxels, whatever the shape of the
//! object. On real scenes the shares are worse: a car whose voxels look like a crown was named a tree. So
//! this model also learns from a copy of each object. The shares of the copy are a weighted mean of the
//! shares of the object and of another object of the drive, with a random weight. The study is in
//! `benches/results/street.md`, section "Cars of real scenes".

use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::training::Sample;
use crate::cluster::street::settings::CLASSES;

/// A copy of each sample to learn from. Samples that are held out have none.
pub(crate) fn doubtful(samples: &[Sample]) -> Vec<Sample> {
    let learned: Vec<&Sample> = samples.iter().filter(|sample| !sample.held_out).collect();
    let count = learned.len() as u64;
    let copy = |(place, sample): (u64, &&Sample)| {
        let number = xxh3_64_with_seed(&place.to_le_bytes(), count);
        let other = learned[usize::try_from(number % count).unwrap_or_default()];
        // The upper 16 bits, as a number from 0 to 1 that is exact.
        let weight = f32::from((number >> 48) as u16) / 65_536.0;
        // The first features are the shares of the classes. The class that the earlier steps gave follows.
        let mut copy = (*sample).clone();
        let features = &mut copy.features;
        for (share, other) in features.iter_mut().zip(&other.features).take(CLASSES) {
            *share = weight * *share + (1.0 - weight) * other;
        }
        if weight < 0.5 {
            features[CLASSES] = other.features[CLASSES];
        }
        copy
    };
    (0..).zip(&learned).map(copy).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_has_the_shape_of_the_object_and_shares_between_two() {
        let sample = |number: u16, held_out: bool| {
            let number = f32::from(number);
            let mut features = vec![0.0; CLASSES + 3];
            features[0] = number;
            features[CLASSES] = number;
            features[CLASSES + 1] = number;
            Sample::of_class(1, held_out, features)
        };
        let samples: Vec<Sample> = (0..40).map(|number| sample(number, number % 5 == 0)).collect();
        let copies = doubtful(&samples);
        let learned: Vec<&Sample> = samples.iter().filter(|sample| !sample.held_out).collect();
        assert_eq!(copies.len(), learned.len());
        let mut moved = 0;
        for (copy, own) in copies.iter().zip(&learned) {
            assert_eq!(copy.features[CLASSES + 1..], own.features[CLASSES + 1..], "its shape");
            assert_eq!((copy.class, copy.held_out), (own.class, false));
            let share = copy.features[0];
            assert!((0.0..40.0).contains(&share), "{share}");
            // The copy is nearer to the object whose class it has.
            let [from_own, from_other] =
                [own.features[0], copy.features[CLASSES]].map(|of| (share - of).abs());
            let has_own_class = (copy.features[CLASSES] - own.features[CLASSES]).abs() < 0.5;
            assert!(has_own_class || from_other <= from_own, "{share} {own:?}");
            moved += u32::from(from_own > 1.0);
        }
        assert!(moved > 15, "{moved}");
        assert_eq!(doubtful(&samples).len(), doubtful(&copies).len());
        assert!(doubtful(&[]).is_empty());
    }
}
