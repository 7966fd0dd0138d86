//! Disjoint sets of small integers.

/// Disjoint sets over `0..n`. The root of a set is its smallest member, so the result does not depend on the
/// order of the unions. Look-ups halve paths. `n` unions cost O(n log n) in the worst case and are linear in
/// practice. Memory: four bytes per member.
#[derive(Debug, Clone)]
pub struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// `len` sets of one member each.
    #[must_use]
    pub fn new(len: u32) -> Self {
        Self { parent: (0..len).collect() }
    }

    /// The smallest member of the set of `member`.
    #[inline]
    pub fn find(&mut self, mut member: u32) -> u32 {
        loop {
            let parent = self.parent[member as usize];
            if parent == member {
                return member;
            }
            let grandparent = self.parent[parent as usize];
            self.parent[member as usize] = grandparent;
            member = grandparent;
        }
    }

    /// Unites the sets of `a` and `b`.
    #[inline]
    pub fn union(&mut self, a: u32, b: u32) {
        let a = self.find(a);
        let b = self.find(b);
        self.parent[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_the_smallest_member_in_any_order_of_unions() {
        for unions in [[(4, 2), (2, 5), (1, 3)], [(2, 5), (1, 3), (5, 4)], [(3, 1), (4, 5), (4, 2)]] {
            let mut sets = DisjointSets::new(6);
            for (a, b) in unions {
                sets.union(a, b);
            }
            let roots: Vec<u32> = (0..6).map(|member| sets.find(member)).collect();
            assert_eq!(roots, [0, 1, 2, 1, 2, 2], "{unions:?}");
        }
    }
}
