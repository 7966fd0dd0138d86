//! Small random streets from a seed: a course, ground beside it, objects, isolated points.
//!
//! Coordinates are multiples of 10 mm. Many steps between points are exactly the thresholds of the methods,
//! so that ties and equalities are frequent.

use rand::seq::IndexedRandom;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::util::las::Point;

/// The course of the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Course {
    /// Straight on.
    Straight,
    /// Out, and back on the next lane.
    Hairpin,
    /// Round a block, back to the start.
    Loop,
    /// Out on one carriageway, and back on the other, 14 m away.
    Carriageways,
}

/// All courses.
pub(crate) const COURSES: [Course; 4] =
    [Course::Straight, Course::Hairpin, Course::Loop, Course::Carriageways];

impl Course {
    /// Position in metres at the share `at` (0 to 1) of the drive.
    pub(crate) fn place(self, at: f64) -> [f64; 2] {
        let there_and_back = |apart: f64| {
            if at < 0.5 { [120.0 * at, 0.0] } else { [120.0 * (1.0 - at), apart] }
        };
        match self {
            Self::Straight => [80.0 * at, 12.0 * at],
            Self::Hairpin => there_and_back(2.5),
            Self::Carriageways => there_and_back(14.0),
            Self::Loop => {
                let angle = at * std::f64::consts::TAU;
                [12.0 * angle.cos(), 12.0 * angle.sin()]
            }
        }
    }
}

/// Seconds a drive takes.
pub(crate) const DRIVE_S: f64 = 30.0;

/// The parameters of a street.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Street {
    /// Seed.
    pub(crate) seed: u64,
    /// Course.
    pub(crate) course: Course,
    /// Number of objects beside it.
    pub(crate) things: usize,
    /// Largest number of points of an object.
    pub(crate) thing_points: usize,
    /// Patches of ground.
    pub(crate) patches: usize,
    /// Isolated points.
    pub(crate) strays: usize,
    /// Origin of the coordinates, in millimetres.
    pub(crate) base_mm: [i64; 3],
}

impl Street {
    /// A street of a few thousand points.
    pub(crate) fn middling(seed: u64, course: Course) -> Self {
        Self { seed, course, things: 40, thing_points: 60, patches: 120, strays: 20, base_mm: [0; 3] }
    }

    /// Its points in order of time.
    pub(crate) fn points(&self) -> Vec<Point> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut points = Vec::new();
        for _ in 0..self.things {
            let (at, start) = self.beside(&mut random, 5.0, 3.0);
            self.thing(at, start, &mut random, &mut points);
        }
        for _ in 0..self.patches {
            let (at, start) = self.beside(&mut random, 6.0, 0.1);
            for _ in 0..random.random_range(1..8) {
                let shift = [0, 1].map(|_| random.random_range(-60..=60) * 10);
                let mm =
                    [start[0] + shift[0], start[1] + shift[1], start[2] + random.random_range(0..9) * 10];
                points.push(Point { mm, time: at * DRIVE_S, mark: 0 });
            }
        }
        for _ in 0..self.strays {
            let (at, mm) = self.beside(&mut random, 9.0, 7.0);
            points.push(Point { mm, time: at * DRIVE_S, mark: 0 });
        }
        points.sort_by(|a, b| a.time.total_cmp(&b.time));
        number(&mut points);
        points
    }

    /// A place beside the course, and the share of the drive at which the vehicle passes it.
    fn beside(&self, random: &mut impl Rng, wide_m: f64, high_m: f64) -> (f64, [i64; 3]) {
        let at = random.random_range(0.0..1.0);
        let [x, y] = self.course.place(at);
        let dx = random.random_range(-wide_m..wide_m);
        let dy = random.random_range(-wide_m..wide_m);
        let place = [x + dx, y + dy, random.random_range(0.0..high_m)];
        (at, std::array::from_fn(|axis| self.base_mm[axis] + round_to_cm(place[axis])))
    }

    /// An object: a chain of points, each one step away from an earlier one.
    fn thing(&self, at: f64, start: [i64; 3], random: &mut impl Rng, points: &mut Vec<Point>) {
        const STEPS: [i64; 9] = [0, 0, 100, 200, 290, 300, 310, 450, 1_200];
        let first = points.len();
        let count = random.random_range(1..=self.thing_points);
        // Long objects are along x or y, so that they cross tiles.
        let along = random.random_range(0..3_usize);
        points.push(Point { mm: start, time: at * DRIVE_S, mark: 0 });
        let stands = random.random_bool(0.7);
        for _ in 1..count {
            let from = if random.random_bool(0.7) {
                points.len() - 1
            } else {
                random.random_range(first..points.len())
            };
            let mut mm = points[from].mm;
            let axis = if random.random_bool(0.6) { along } else { random.random_range(0..3) };
            let step = *STEPS.choose(random).expect("steps");
            mm[axis] += if axis == along || random.random_bool(0.5) { step } else { -step };
            mm[2] = mm[2].max(self.base_mm[2]);
            points.push(Point { mm, time: at * DRIVE_S, mark: 0 });
        }
        if stands {
            // Ground below the object. Otherwise its own points would be the lowest ones.
            for step in 0..4 {
                let mm = [start[0] + step % 2 * 200, start[1] + step / 2 * 200, self.base_mm[2]];
                points.push(Point { mm, time: at * DRIVE_S, mark: 0 });
            }
        }
    }

    /// The trajectory of the drive as CSV.
    pub(crate) fn trajectory(&self) -> String {
        let mut text = "gps_time,x,y,z\n".to_owned();
        for step in 0..=200 {
            let at = f64::from(step) / 200.0;
            let [x, y] = self.course.place(at);
            let metres = |axis: usize, value: f64| self.base_mm[axis] as f64 / 1_000.0 + value;
            text.push_str(&format!("{},{},{},0\n", at * DRIVE_S, metres(0, x), metres(1, y)));
        }
        text
    }
}

#[expect(clippy::cast_possible_truncation, reason = "metres of a small street")]
fn round_to_cm(metres: f64) -> i64 {
    (metres * 100.0).round() as i64 * 10
}

/// Gives each point its index in the list as mark, modulo the range of a mark.
pub(crate) fn number(points: &mut [Point]) {
    for (index, point) in points.iter_mut().enumerate() {
        point.mark = u16::try_from(index % 65_536).expect("below");
    }
}

/// A seeded permutation of `0..count`.
pub(crate) fn permutation(count: usize, seed: u64) -> Vec<usize> {
    use rand::seq::SliceRandom;
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    order
}
