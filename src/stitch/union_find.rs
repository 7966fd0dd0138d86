//! Union-find whose root is always the smallest member, so that the order of unions cannot show in the result.

/// Disjoint sets over `0..len`.
#[derive(Debug, Clone)]
pub struct UnionFind {
    parent: Vec<u32>,
}

impl UnionFind {
    /// `len` sets of one member each.
    #[must_use]
    pub fn new(len: u32) -> Self {
        Self { parent: (0..len).collect() }
    }

    /// The smallest member of the set of `member`.
    pub fn root(&mut self, mut member: u32) -> u32 {
        // Path halving: every second member on the way points two up.
        while self.parent[member as usize] != member {
            let above = self.parent[member as usize];
            self.parent[member as usize] = self.parent[above as usize];
            member = above;
        }
        member
    }

    /// Makes the sets of `a` and `b` one.
    pub fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // The larger root hangs below the smaller: the root stays the minimum.
        self.parent[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_the_smallest_member_in_any_order() {
        let unions = [(4, 7), (2, 9), (7, 9), (5, 6), (0, 1)];
        for rotation in 0..unions.len() {
            let mut sets = UnionFind::new(10);
            for k in 0..unions.len() {
                let (a, b) = unions[(k + rotation) % unions.len()];
                sets.unite(a, b);
            }
            let roots: Vec<u32> = (0..10).map(|member| sets.root(member)).collect();
            assert_eq!(roots, [0, 0, 2, 3, 2, 5, 5, 2, 8, 2]);
        }
    }
}
