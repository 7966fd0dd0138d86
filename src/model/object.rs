//! Temporary.
use serde::{Deserialize, Serialize};
use crate::model::TileCloud;
/// x
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ObjectPart {
    /// x
    pub points: u64,
    /// x
    pub first_id: u64,
    /// x
    pub lo: [i64; 3],
    /// x
    pub hi: [i64; 3],
    /// x
    pub sum: [i128; 3],
    /// x
    pub hull: Vec<[i64; 2]>,
    /// x
    pub files: Vec<u32>,
}
impl ObjectPart {
    /// x
    pub fn collect(cloud: &TileCloud, labels: &[u32], count: u32, core: impl Fn(usize) -> bool, file: impl Fn(u64) -> u32) -> Vec<Self> {
        let mut parts = vec![Self { first_id: u64::MAX, lo: [i64::MAX; 3], hi: [i64::MIN; 3], ..Self::default() }; count as usize];
        for (p, &l) in labels.iter().enumerate() {
            if l == 0 || !core(p) { continue; }
            let part = &mut parts[l as usize - 1];
            let q = cloud.lattice_point(p);
            part.points += 1;
            part.first_id = part.first_id.min(cloud.id[p]);
            for k in 0..3 { part.lo[k] = part.lo[k].min(q[k]); part.hi[k] = part.hi[k].max(q[k]); part.sum[k] += i128::from(q[k]); }
            let f = file(cloud.id[p]);
            if part.files.last() != Some(&f) && !part.files.contains(&f) { part.files.push(f); part.files.sort_unstable(); }
        }
        parts
    }
    /// x
    pub fn merge(&mut self, o: &Self) {
        self.points += o.points; self.first_id = self.first_id.min(o.first_id);
        for k in 0..3 { self.lo[k] = self.lo[k].min(o.lo[k]); self.hi[k] = self.hi[k].max(o.hi[k]); self.sum[k] += o.sum[k]; }
        self.files.extend(&o.files); self.files.sort_unstable(); self.files.dedup();
    }
    /// x
    pub fn hull_area_units2(&self) -> f64 { 0.0 }
}
