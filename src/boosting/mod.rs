//! Boosted trees: learns from a table which class a row belongs to, and gives the share of each class for
//! other rows. It knows nothing about points: a row is a list of numbers.
//!
//! The method is gradient boosting on histograms with the loss of the multinomial logit. Each round grows one
//! tree per class to the gradients and curvatures of the loss (Friedman 2001, doi:10.1214/aos/1013203451;
//! second order as in Chen and Guestrin 2016, doi:10.1145/2939672.2939785). A tree splits the leaf with the
//! largest gain first, on columns of few bins (Ke et al. 2017, "LightGBM").
//!
//! The same table, settings and seed give the same bytes for any number of threads and on any platform. For
//! this, gradients, curvatures and scores are whole numbers, so that their sums do not depend on an order.
//! The exponential function is our own sequence of IEEE operations, because the functions of the platforms
//! differ in the last bit.
//!
//! Existing libraries were examined in November 2026, and none is suitable. `smartcore` 0.7 and
//! `linfa-ensemble` 0.8 boost regressions or stumps, but not trees of several classes. `biosphere` 0.4 has
//! forests only. `perpetual` 3.0 chooses the size of the model itself, and limits neither its bytes nor its
//! time. `hessboost` 0.4 has all options, but it has 106,000 lines and a compressor in C, and promises equal
//! models for any number of threads, but not for any platform. None evaluates blocks of rows by bit masks,
//! although evaluation takes most of the time here ([`Model::shares`]).
//!
//! ```
//! use chainage::boosting::{Samples, Settings, learn};
//!
//! // Two classes that a threshold of the second column separates.
//! let mut samples = Samples::new(&["noise", "signal"], &["low", "high"]);
//! for row in 0..400_u16 {
//!     let signal = f32::from(row % 20);
//!     samples.push(&[f32::from(row % 7), signal], u8::from(signal > 9.0))?;
//! }
//! let settings = Settings { rounds: 10, ..Settings::default() };
//! let model = learn(&samples, &settings, &|_| Ok(()))?;
//! let shares = model.shares::<2>(&[3.0, 2.0, 3.0, 15.0])?;
//! assert!(shares[0][0] > 200 && shares[1][1] > 200);
//! # Ok::<(), chainage::Error>(())
//! ```

#[cfg(target_arch = "x86_64")]
mod avx2;
mod bins;
mod confusion;
mod content;
mod error;
mod evaluate;
mod exponential;
mod file;
mod grow;
mod learn;
mod model;
mod portable;
mod samples;
mod settings;
mod tree;

pub use confusion::Confusion;
pub use content::{About, TrainedOn};
pub use error::BoostingError;
pub use learn::learn;
pub use model::Model;
pub use samples::Samples;
pub use settings::Settings;
