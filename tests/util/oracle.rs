//! Brute-force references: the methods word by word over all pairs of points, in O(n^2) or worse. They share
//! no code with the library and are slow on purpose. Points are lattice coordinates, lengths are lattice
//! units.

/// Points of isolated noise: 0 for none, 2 for low and 3 for high noise.
pub(crate) fn noise(points: &[[i64; 3]], voxel: i64, min_points: usize, high: i64) -> Vec<u8> {
    let voxels: Vec<[i64; 3]> = points.iter().map(|p| p.map(|value| value.div_euclid(voxel))).collect();
    let components =
        components(points.len(), |a, b| (0..3).all(|axis| (voxels[a][axis] - voxels[b][axis]).abs() <= 1));
    let size = |point: usize| components.iter().filter(|&&other| other == components[point]).count();
    let is_noise: Vec<bool> = (0..points.len()).map(|point| size(point) < min_points).collect();
    let verdict = |point: usize| {
        if !is_noise[point] {
            return 0;
        }
        let lowest = (0..points.len())
            .filter(|&other| !is_noise[other] && beside(voxels[point], voxels[other], voxel) <= 1_500 * 1_500)
            .map(|other| voxels[other][2])
            .min();
        match lowest {
            Some(lowest) if (voxels[point][2] - lowest) * voxel > high => 3,
            _ => 2,
        }
    };
    (0..points.len()).map(verdict).collect()
}

/// Whether each point is ground by `voxel-column`. Points with `hidden` set are ignored.
pub(crate) fn voxel_column(
    points: &[[i64; 3]],
    hidden: &[bool],
    [voxel, run_height, step, radius]: [i64; 4],
) -> Vec<bool> {
    let voxels: Vec<[i64; 3]> = points.iter().map(|p| p.map(|value| value.div_euclid(voxel))).collect();
    let occupied = |wanted: [i64; 3]| (0..points.len()).any(|p| !hidden[p] && voxels[p] == wanted);
    let lowest_of = |[i, j, _]: [i64; 3]| {
        let in_column = |p: &usize| !hidden[*p] && voxels[*p][0] == i && voxels[*p][1] == j;
        (0..points.len()).filter(in_column).map(|p| voxels[p][2]).min()
    };
    let is_ground = |point: usize| {
        let [i, j, k] = voxels[point];
        let Some(low) = lowest_of(voxels[point]).filter(|_| !hidden[point]) else { return false };
        let mut length = 0;
        while occupied([i, j, low + length]) {
            length += 1;
        }
        let lowest_near = (0..points.len())
            .filter(|&other| !hidden[other] && beside(voxels[point], voxels[other], voxel) <= radius * radius)
            .map(|other| voxels[other][2])
            .min();
        k < low + length && length * voxel < run_height && (low - lowest_near.unwrap_or(low)) * voxel < step
    };
    (0..points.len()).map(is_ground).collect()
}

/// Single-link clusters: for each point, the smallest index of a point connected with it.
pub(crate) fn single_link(points: &[[i64; 3]], distance: i64) -> Vec<usize> {
    components(points.len(), |a, b| {
        let squares = (0..3).map(|axis| (points[a][axis] - points[b][axis]).pow(2));
        squares.sum::<i64>() <= distance * distance
    })
}

/// `dbscan`, variant `size`, over all pairs: 0 for noise, clusters numbered by their smallest index. `near`
/// is the squared distance of two points.
pub(crate) fn dbscan_size(
    count: usize,
    near: impl Fn(usize, usize) -> i64,
    limit: i64,
    min_points: usize,
    max_points: usize,
) -> Vec<u32> {
    let names = components(count, |a, b| near(a, b) <= limit);
    numbered(&names.into_iter().map(Some).collect::<Vec<_>>(), min_points, max_points)
}

/// `dbscan`, variant `core`, over all pairs; border points go to the nearest core point, ties to the smaller
/// index.
pub(crate) fn dbscan_core(
    count: usize,
    near: impl Fn(usize, usize) -> i64,
    limit: i64,
    min_points: usize,
    max_points: usize,
) -> Vec<u32> {
    let is_core: Vec<bool> =
        (0..count).map(|a| (0..count).filter(|&b| near(a, b) <= limit).count() >= min_points).collect();
    let names = components(count, |a, b| is_core[a] && is_core[b] && near(a, b) <= limit);
    let name = |point: usize| {
        let cores = (0..count).filter(|&core| is_core[core] && near(point, core) <= limit);
        cores.min_by_key(|&core| (near(point, core), core)).map(|core| names[core])
    };
    numbered(&(0..count).map(name).collect::<Vec<_>>(), 1, max_points)
}

/// Names to numbers from 1 in order of first appearance. Names with too few or too many points become 0.
fn numbered(names: &[Option<usize>], min_points: usize, max_points: usize) -> Vec<u32> {
    let mut known: Vec<usize> = Vec::new();
    let mut label = |name: &Option<usize>| {
        let points = names.iter().filter(|other| *other == name).count();
        let Some(name) = name.filter(|_| (min_points..=max_points).contains(&points)) else { return 0 };
        if !known.contains(&name) {
            known.push(name);
        }
        u32::try_from(known.iter().position(|other| *other == name).unwrap_or(0) + 1).unwrap_or(u32::MAX)
    };
    names.iter().map(&mut label).collect()
}

/// Squared horizontal distance of the centres of two columns.
fn beside(a: [i64; 3], b: [i64; 3], voxel: i64) -> i64 {
    ((a[0] - b[0]) * voxel).pow(2) + ((a[1] - b[1]) * voxel).pow(2)
}

/// The smallest index connected with each of `count` things: names spread until nothing changes.
fn components(count: usize, connected: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    let mut names: Vec<usize> = (0..count).collect();
    loop {
        let before = names.clone();
        for a in 0..count {
            for b in 0..count {
                if names[b] < names[a] && connected(a, b) {
                    names[a] = names[b];
                }
            }
        }
        if names == before {
            return names;
        }
    }
}
