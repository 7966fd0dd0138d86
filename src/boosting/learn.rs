//! The rounds of boosting.

use rayon::prelude::*;

use super::bins::Binned;
use super::content::About;
use super::error::BoostingError;
use super::exponential::{UNITS, ln, softmax};
use super::grow::{GRADIENT_UNITS, Grower, Grown, MOST_SAMPLES, Slopes, Sum};
use super::model::Model;
use super::samples::Samples;
use super::settings::Settings;
use super::tree::Tree;
use crate::error::Result;

/// Largest weight of a sample, relative to the mean weight: rarer classes are not weighted up further.
const LARGEST_WEIGHT: f64 = 64.0;

/// Smallest share of a class in the first scores.
const LEAST_SHARE: f64 = 1e-6;

/// Learns a model. `tell` receives the number of complete rounds. Its error ends the learning.
///
/// A sample weighs one over the square root of the number of samples of its class. So a rare class counts
/// more than in proportion to its number, but still less than a frequent class.
///
/// # Errors
/// [`BoostingError::Setting`] for a setting out of range, [`BoostingError::Samples`] when there is nothing to
/// learn, and any error of `tell`.
pub fn learn(samples: &Samples, settings: &Settings, tell: &dyn Fn(usize) -> Result<()>) -> Result<Model> {
    settings.validate()?;
    let counts = samples.counts();
    let wrong = |why: &str| BoostingError::Samples { samples: samples.len(), why: why.to_owned() };
    if counts.iter().filter(|&&count| count > 0).count() < 2 {
        return Err(wrong("they are all of one class").into());
    }
    if samples.features().is_empty() || samples.features().len() > usize::from(u16::MAX) {
        return Err(wrong("a sample needs 1 to 65,535 features").into());
    }
    if samples.len() > MOST_SAMPLES {
        return Err(wrong("at most 16,777,215 are possible").into());
    }
    let mut binned = Binned::of(samples, settings.bins);
    let weights = weights(&counts);
    let base = first_scores(&counts, &weights);
    let classes = counts.len();
    // Class by class within a sample.
    let mut scores: Vec<i32> = base.repeat(samples.len());
    let mut trees: Vec<Tree> = Vec::with_capacity(settings.rounds * classes);
    let mut importance = vec![0.0; samples.features().len()];
    let grower = Grower::new(&binned, settings);
    for round in 0..settings.rounds {
        let slopes = slopes(samples.class(), &weights, &scores);
        let grown: Vec<Grown> = (0..classes)
            .into_par_iter()
            .map(|class| {
                let slopes = Slopes { of_samples: &slopes, classes, class };
                grower.grow(slopes, (round * classes + class) as u64)
            })
            .collect();
        for (class, grown) in grown.into_iter().enumerate() {
            for (members, value) in grown.samples.iter().zip(&grown.tree.values) {
                members.iter().for_each(|&sample| scores[sample as usize * classes + class] += value);
            }
            grown.gains.iter().for_each(|&(feature, gain)| importance[feature] += gain);
            trees.push(grown.tree);
        }
        tell(round + 1)?;
    }
    let mut used: Vec<Vec<bool>> = binned.thresholds.iter().map(|cuts| vec![false; cuts.len()]).collect();
    for split in trees.iter().flat_map(|tree| &tree.splits) {
        used[usize::from(split.feature)][usize::from(split.threshold)] = true;
    }
    let numbers = Binned::keep(&mut binned.thresholds, &used);
    for split in trees.iter_mut().flat_map(|tree| &mut tree.splits) {
        split.threshold = numbers[usize::from(split.feature)][usize::from(split.threshold)];
    }
    let total: f64 = importance.iter().sum();
    let Settings { rounds, leaves, rate, l2, leaf_samples, features, bins, subsample, seed: _ } = settings;
    let of_samples = if *subsample < 1.0 { format!(", subsample {subsample}") } else { String::new() };
    let about = About {
        settings: format!(
            "rounds {rounds}, leaves {leaves}, rate {rate}, l2 {l2}, leaf_samples {leaf_samples}, \
             features {features}, bins {bins}{of_samples}"
        ),
        seed: settings.seed,
        samples: counts,
        importance: importance.iter().map(|gain| if total > 0.0 { gain / total } else { 0.0 }).collect(),
        trained_on: Vec::new(),
    };
    Model::new(samples.features().to_vec(), samples.classes().to_vec(), binned.thresholds, base, trees, about)
}

/// Weight of a sample of each class, relative to the mean over the samples.
fn weights(counts: &[u64]) -> Vec<f64> {
    let raw: Vec<f64> =
        counts.iter().map(|&count| if count > 0 { 1.0 / (count as f64).sqrt() } else { 0.0 }).collect();
    let sum: f64 = raw.iter().zip(counts).map(|(weight, &count)| weight * count as f64).sum();
    let mean = sum / counts.iter().sum::<u64>() as f64;
    raw.iter().map(|weight| (weight / mean).min(LARGEST_WEIGHT)).collect()
}

/// The scores before the first tree: logarithms of the weighted shares of the classes.
fn first_scores(counts: &[u64], weights: &[f64]) -> Vec<i32> {
    let shares: Vec<f64> = counts.iter().zip(weights).map(|(&count, weight)| count as f64 * weight).collect();
    let sum: f64 = shares.iter().sum();
    let score = |share: &f64| {
        #[expect(clippy::cast_possible_truncation, reason = "from -14 to 0 times 65,536")]
        let score = (ln((share / sum).max(LEAST_SHARE)) * UNITS).round() as i32;
        score
    };
    shares.iter().map(score).collect()
}

/// Gradient and curvature of the loss at each sample, class by class within a sample.
fn slopes(class: &[u8], weights: &[f64], scores: &[i32]) -> Vec<Sum> {
    let classes = weights.len();
    let mut slopes = vec![Sum::default(); scores.len()];
    let rows = slopes.par_chunks_exact_mut(classes).zip(scores.par_chunks_exact(classes)).zip(class);
    rows.for_each_init(
        || vec![0.0; classes],
        |probabilities, ((slopes, scores), &class)| {
            softmax(scores, probabilities);
            let weight = weights[usize::from(class)] * GRADIENT_UNITS;
            for (other, (slope, &probability)) in slopes.iter_mut().zip(probabilities.iter()).enumerate() {
                let gradient = probability - f64::from(u8::from(other == usize::from(class)));
                *slope = Sum::of(whole(weight * gradient), whole(weight * probability * (1.0 - probability)));
            }
        },
    );
    slopes
}

/// The nearest whole number. Its size is below 64 times [`GRADIENT_UNITS`].
fn whole(value: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "below 2^22")]
    let value = value.round() as i64;
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table of eight columns of noise, whose class is a function of the row.
    fn table(rows: u64, classes: &[&str], class: impl Fn(&[f32]) -> usize) -> Samples {
        let names: Vec<String> = (0..8).map(|column| format!("column {column}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let mut samples = Samples::new(&names, classes);
        for row in 0..rows {
            let value = |column: u64| {
                let bits =
                    xxhash_rust::xxh3::xxh3_64([row.to_le_bytes(), column.to_le_bytes()].as_flattened());
                u16::try_from(bits >> 48).map_or(0.0, f32::from) / 65_536.0
            };
            let values: Vec<f32> = (0..8).map(value).collect();
            samples.push(&values, u8::try_from(class(&values)).unwrap()).unwrap();
        }
        samples
    }

    fn right<const K: usize>(model: &Model, samples: &Samples) -> f64 {
        let shares = model.shares::<K>(samples.values()).unwrap();
        let best = |shares: &[u8; K]| (0..K).max_by_key(|&class| shares[class]).unwrap();
        let right =
            shares.iter().zip(samples.class()).filter(|(shares, class)| best(shares) == usize::from(**class));
        right.count() as f64 / samples.len() as f64
    }

    fn quick() -> Settings {
        Settings { rounds: 20, leaves: 8, leaf_samples: 20, features: 1.0, ..Settings::default() }
    }

    #[test]
    fn what_depends_on_two_columns_together_is_learned() {
        let xor = |row: &[f32]| usize::from((row[2] > 0.5) != (row[5] > 0.3));
        let samples = table(4_000, &["same", "different"], xor);
        let (train, test) = (table(2_000, &["same", "different"], xor), &samples);
        let model = learn(&train, &quick(), &|_| Ok(())).unwrap();
        assert!(right::<2>(&model, test) > 0.97, "{}", right::<2>(&model, test));
        let importance = &model.about().importance;
        assert!(importance[2] + importance[5] > 0.9, "{importance:?}");
        // Neither column alone says anything about the class.
        let alone = learn(&train, &Settings { leaves: 2, ..quick() }, &|_| Ok(())).unwrap();
        assert!(right::<2>(&alone, test) < 0.75);
    }

    #[test]
    fn several_classes_are_told_apart_also_rare_and_absent_ones() {
        let class = |row: &[f32]| match row[0] {
            value if value < 0.02 => 3,
            value if value < 0.5 => 0,
            _ if row[1] < row[2] => 1,
            _ => 4,
        };
        let samples = table(6_000, &["a", "b", "absent", "rare", "e"], class);
        let model = learn(&samples, &quick(), &|_| Ok(())).unwrap();
        let shares = model.shares::<5>(samples.values()).unwrap();
        for (shares, &class) in shares.iter().zip(samples.class()) {
            assert!(shares[2] == 0 && (class != 3 || shares[3] > 100), "{class} {shares:?}");
        }
        assert!(right::<5>(&model, &samples) > 0.93);
        assert_eq!(model.about().samples, samples.counts());
    }

    #[test]
    fn threads_change_no_byte_and_the_seed_does() {
        let samples =
            table(3_000, &["a", "b", "c"], |row| usize::from(row[0] > 0.5) + usize::from(row[3] > 0.6));
        let settings = Settings { features: 0.5, rounds: 6, ..quick() };
        let bytes = |threads: usize, settings: &Settings| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| learn(&samples, settings, &|_| Ok(())).unwrap().encode().unwrap())
        };
        let one = bytes(1, &settings);
        assert_eq!(one, bytes(2, &settings));
        assert_eq!(one, bytes(5, &settings));
        assert_ne!(one, bytes(1, &Settings { seed: 1, ..settings.clone() }));
        // Computed once. Every platform and compiler must give the same.
        assert_eq!(xxhash_rust::xxh3::xxh3_64(&one), 16_090_246_880_578_227_481);
    }

    #[test]
    fn trees_of_a_part_of_the_samples_learn_from_all_of_them_together() {
        let class = |row: &[f32]| usize::from((row[2] > 0.5) != (row[5] > 0.3));
        let (train, test) = (table(2_000, &["a", "b"], class), table(4_000, &["a", "b"], class));
        let part = Settings { subsample: 0.3, rounds: 40, ..quick() };
        let model = learn(&train, &part, &|_| Ok(())).unwrap();
        assert!(right::<2>(&model, &test) > 0.95, "{}", right::<2>(&model, &test));
        let bytes = |settings: &Settings| learn(&train, settings, &|_| Ok(())).unwrap().encode().unwrap();
        assert_eq!(bytes(&part), bytes(&part));
        assert_ne!(bytes(&part), bytes(&Settings { subsample: 1.0, ..part.clone() }));
    }

    #[test]
    fn one_class_or_no_sample_teaches_nothing() {
        for samples in [table(0, &["a", "b"], |_| 0), table(50, &["a", "b"], |_| 1)] {
            let error = learn(&samples, &quick(), &|_| Ok(())).unwrap_err().to_string();
            assert!(error.contains("all of one class"), "{error}");
        }
    }
}
