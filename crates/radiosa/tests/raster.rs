//! Scan conversion covers what it should: every sample of a mesh once, whatever its edges do.

use radiosa::math::{CpuPath, DMat3, DVec3, Vec3};
use radiosa::raster::scan::snap;
use radiosa::raster::{Projection, TILE, Tile, Triangle, clip};
use radiosa::sampling::rng::Stream;

const SIDE: u32 = 512;

/// Adds one to every sample a triangle covers, as additive blending would.
fn add(counts: &mut [u32], path: CpuPath, v: [[i32; 2]; 3]) {
    let Some(triangle) = Triangle::new(v, 0) else { return };
    let first = Tile::of_picture(0, 0, SIDE, SIDE, [0.0; 2]).first;
    let Some([x0, y0, x1, y1]) = triangle.pixels(first, 0) else { return };
    let last = SIDE as i32 - 1;
    if x1 < 0 || y1 < 0 || x0 > last || y0 > last {
        return;
    }
    let mut covered = Vec::new();
    let tile = |v: i32| v.clamp(0, last) as u32 / TILE;
    for y in tile(y0)..=tile(y1) {
        for x in tile(x0)..=tile(x1) {
            covered.clear();
            triangle.samples(path, &Tile::of_picture(x * TILE, y * TILE, SIDE, SIDE, [0.0; 2]), &mut covered);
            for s in &covered {
                let (dx, dy) = (u32::from(s.index) % TILE, u32::from(s.index) / TILE);
                counts[((y * TILE + dy) * SIDE + x * TILE + dx) as usize] += 1;
            }
        }
    }
}

/// Samples by how often they were covered: never, once, more than once.
fn tally(counts: &[u32]) -> [usize; 3] {
    counts.iter().fold([0; 3], |mut t, &c| {
        t[c.min(2) as usize] += 1;
        t
    })
}

/// A net of `n[0] × n[1]` cells over the whole picture and a little beyond, its inner vertices moved by up to `jitter` cells and rounded to `grain` steps, each cell cut
/// along one of its diagonals.
fn net(n: [u32; 2], jitter: f32, grain: i32, seed: u64) -> Vec<[[i32; 2]; 3]> {
    let mut random = Stream::new(seed, 0, 0);
    let cell = n.map(|n| (SIDE as f32 + 2.0) * 256.0 / n as f32);
    let half = (SIDE as f32 + 2.0) * 128.0;
    let mut vertices = Vec::new();
    for j in 0..=n[1] {
        for i in 0..=n[0] {
            let u = random.next_2d() - radiosa::math::Vec2::splat(0.5);
            let inner = i > 0 && j > 0 && i < n[0] && j < n[1];
            let moved = if inner { u * (2.0 * jitter) } else { radiosa::math::Vec2::ZERO };
            let place = |axis: usize, k: u32, d: f32| {
                let v = (k as f32 + d) * cell[axis] - half;
                if inner { (v / grain as f32).round() as i32 * grain } else { v.round() as i32 }
            };
            vertices.push([place(0, i, moved.x), place(1, j, moved.y)]);
        }
    }
    let at = |i: u32, j: u32| vertices[(j * (n[0] + 1) + i) as usize];
    let mut triangles = Vec::new();
    for j in 0..n[1] {
        for i in 0..n[0] {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            let (one, two) = if random.next_f32() < 0.5 { ([a, b, c], [a, c, d]) } else { ([a, b, d], [b, c, d]) };
            // Either winding: the rule must not depend on it.
            let turned = |t: [[i32; 2]; 3], r: f32| if r < 0.5 { t } else { [t[0], t[2], t[1]] };
            triangles.push(turned(one, random.next_f32()));
            triangles.push(turned(two, random.next_f32()));
        }
    }
    triangles
}

#[test]
fn a_million_shared_edges_leave_no_crack_and_draw_nothing_twice() {
    let (mut n_edges, mut n_slivers) = (0, 0);
    // Cells from a hundred pixels down to half a pixel; vertices anywhere, and on pixel centres and corners, where edges pass through samples.
    let even =
        [(5, 1), (37, 128), (64, 256), (150, 1), (150, 128), (250, 64), (300, 1), (360, 1)].map(|(n, grain)| ([n, n], grain));
    // Slivers: across the whole picture and less than a pixel high, and as many upright.
    let long = [([2, 900], 1), ([900, 3], 1), ([7, 400], 1)];
    for (n, grain) in even.into_iter().chain(long) {
        let triangles = net(n, 0.15, grain, u64::from(n[0]) + grain as u64);
        n_edges += triangles.len() * 3 / 2;
        n_slivers += triangles.iter().filter(|t| is_sliver(t)).count();
        for path in [CpuPath::Portable, CpuPath::detect()] {
            let mut counts = vec![0; (SIDE * SIDE) as usize];
            triangles.iter().for_each(|t| add(&mut counts, path, *t));
            let [never, _, often] = tally(&counts);
            assert_eq!((never, often), (0, 0), "{n:?} cells, grain {grain}, {path}");
        }
    }
    println!("{n_edges} edges, {n_slivers} slivers");
    assert!(n_edges > 1_000_000 && n_slivers > 10_000, "{n_edges} edges, {n_slivers} slivers");
}

/// Ten times as long as it is high.
fn is_sliver(v: &[[i32; 2]; 3]) -> bool {
    let d = |a: [i32; 2], b: [i32; 2]| [f64::from(b[0] - a[0]), f64::from(b[1] - a[1])];
    let (a, b) = (d(v[0], v[1]), d(v[0], v[2]));
    let longest = [a, b, d(v[1], v[2])].iter().map(|e| e[0] * e[0] + e[1] * e[1]).fold(0.0, f64::max);
    10.0 * (a[0] * b[1] - a[1] * b[0]).abs() < longest
}

/// The twin: closed triangles, as a rule that includes all edges has them, or open ones.
fn with_all_edges(counts: &mut [u32], v: [[i32; 2]; 3], closed: bool) {
    let edge = |a: [i32; 2], b: [i32; 2], p: [i32; 2]| {
        i64::from(b[0] - a[0]) * i64::from(p[1] - a[1]) - i64::from(b[1] - a[1]) * i64::from(p[0] - a[0])
    };
    let sign = edge(v[0], v[1], v[2]).signum();
    let low = |k: usize| v.iter().map(|p| p[k]).min().unwrap_or(0);
    let high = |k: usize| v.iter().map(|p| p[k]).max().unwrap_or(0);
    let pixel = |v: i32| (v + SIDE as i32 * 128).div_euclid(256).clamp(0, SIDE as i32 - 1);
    for y in pixel(low(1))..=pixel(high(1)) {
        for x in pixel(low(0))..=pixel(high(0)) {
            let p = [x * 256 + 128 - SIDE as i32 * 128, y * 256 + 128 - SIDE as i32 * 128];
            let inside = (0..3).all(|i| {
                let e = sign * edge(v[i], v[(i + 1) % 3], p);
                e > 0 || (closed && e == 0)
            });
            counts[(y * SIDE as i32 + x) as usize] += u32::from(inside && sign != 0);
        }
    }
}

#[test]
fn the_test_catches_rules_that_include_or_exclude_every_edge() {
    let triangles = net([64, 64], 0.15, 128, 1);
    for closed in [true, false] {
        let mut counts = vec![0; (SIDE * SIDE) as usize];
        triangles.iter().for_each(|t| with_all_edges(&mut counts, *t, closed));
        let [never, _, often] = tally(&counts);
        assert!(if closed { often > 100 } else { never > 100 }, "{never} {often}");
    }
}

#[test]
fn faces_cut_by_the_near_plane_and_the_guard_band_still_meet() {
    // A floor that passes under the eye and behind it, in triangles of very different size.
    let projection = Projection::perspective(DVec3::new(0.0, 1.0, 0.0), &DMat3::IDENTITY, 1.4, f64::from(SIDE), 1e-6);
    let mut random = Stream::new(3, 1, 4);
    const N: usize = 60;
    let line = |i: usize| {
        let t = i as f32 / N as f32 * 2.0 - 1.0;
        t * t * t * 5000.0
    };
    let mut vertices = Vec::new();
    for j in 0..=N {
        for i in 0..=N {
            let u = random.next_2d() * 0.4;
            let inner = i > 0 && j > 0 && i < N && j < N;
            let mix = |k: usize, t: f32| if inner { line(k) + (line(k + 1) - line(k)) * t } else { line(k) };
            vertices.push(Vec3::new(mix(i, u.x), 0.0, mix(j, u.y)));
        }
    }
    let mut counts = vec![0; (SIDE * SIDE) as usize];
    let mut n_clipped = 0;
    for j in 0..N {
        for i in 0..N {
            let at = |i: usize, j: usize| vertices[j * (N + 1) + i];
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            for t in [[0, 1, 2], [0, 2, 3]] {
                let seen = t.map(|k| projection.project(corners[k]));
                let mut polygon = [seen[0]; clip::MAX_CORNERS];
                let n = clip(&projection, &seen, &mut polygon);
                n_clipped += usize::from(n > 3 || (n == 3 && polygon[..3] != seen));
                for k in 2..n {
                    add(&mut counts, CpuPath::detect(), [snap(&polygon[0]), snap(&polygon[k - 1]), snap(&polygon[k])]);
                }
            }
        }
    }
    assert!(n_clipped > 50, "only {n_clipped} faces were cut");
    // Below the edge of the floor, five kilometres away: everything once. Above the horizon: nothing.
    let rows = |from: u32, to: u32| tally(&counts[(from * SIDE) as usize..(to * SIDE) as usize]);
    assert_eq!(rows(0, SIDE / 2 - 1), [(SIDE * (SIDE / 2 - 1)) as usize, 0, 0]);
    assert_eq!(rows(SIDE / 2 + 1, SIDE), [0, (SIDE * (SIDE / 2 - 1)) as usize, 0]);
}
