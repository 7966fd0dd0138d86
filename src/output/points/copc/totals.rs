//! The totals in the header of a cloud-optimised file: sums and extremes over all its points, in any order.

use serde::{Deserialize, Serialize};

/// Totals of records of point formats 6 to 8.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Totals {
    pub(crate) records: u64,
    pub(crate) by_return: [u64; 15],
    pub(crate) low: [i32; 3],
    pub(crate) high: [i32; 3],
    /// First and last finite GPS time.
    pub(crate) time: Option<(f64, f64)>,
}

impl Default for Totals {
    fn default() -> Self {
        Self { records: 0, by_return: [0; 15], low: [i32::MAX; 3], high: [i32::MIN; 3], time: None }
    }
}

impl Totals {
    /// Adds a record.
    pub(crate) fn add(&mut self, record: &[u8]) {
        for axis in 0..3 {
            let at = axis * 4;
            let value = i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
            self.low[axis] = self.low[axis].min(value);
            self.high[axis] = self.high[axis].max(value);
        }
        if let Some(slot) = usize::from(record[14] & 0x0f).checked_sub(1).filter(|slot| *slot < 15) {
            self.by_return[slot] += 1;
        }
        self.records += 1;
        let time = f64::from_le_bytes(std::array::from_fn(|byte| record[22 + byte]));
        if time.is_finite() {
            self.widen((time, time));
        }
    }

    fn widen(&mut self, (first, last): (f64, f64)) {
        let time = self.time.get_or_insert((first, last));
        *time = (time.0.min(first), time.1.max(last));
    }

    /// Adds the totals of other records.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.records += other.records;
        for (sum, part) in self.by_return.iter_mut().zip(other.by_return) {
            *sum += part;
        }
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
        other.time.into_iter().for_each(|time| self.widen(time));
    }
}
