//! Scan conversion covers what it should: every sample of a mesh once, whatever its edges do.

use radiosa::math::{CpuPath, DMat3, DVec3, Vec3};
use radiosa::raster::depth::NOTHING;
use radiosa::raster::scan::snap;
use radiosa::raster::{Bins, Grid, ItemBuffer, Projection, TILE, Tile, Triangle, clip};
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

/// A net of cells over the whole picture and a little beyond.
#[derive(Clone, Copy, Debug)]
struct Net {
    /// Cells across and down.
    n: [u32; 2],
    /// Inner vertices are rounded to so many steps.
    grain: i32,
    /// Steps to the right for each step down, which makes slanted slivers of long cells; the net is so much wider.
    shear: i32,
}

/// The triangles of a net, its inner vertices moved by up to `jitter` cells, each cell cut along one of its diagonals. In whole steps a shear leaves neighbours
/// neighbours.
fn triangles_of(Net { n: [across, down], grain, shear }: Net, jitter: f32, seed: u64) -> Vec<[[i32; 2]; 3]> {
    let mut random = Stream::new(seed, 0, 0);
    let half = (SIDE as f32 + 2.0) * 128.0;
    let sides = [half * (1 + shear) as f32, half];
    let mut vertices = Vec::new();
    for j in 0..=down {
        for i in 0..=across {
            let u = random.next_2d() - radiosa::math::Vec2::splat(0.5);
            let inner = i > 0 && j > 0 && i < across && j < down;
            let moved = if inner { u * (2.0 * jitter) } else { radiosa::math::Vec2::ZERO };
            let place = |k: u32, n: u32, d: f32, half: f32| {
                let v = (k as f32 + d) * (2.0 * half / n as f32) - half;
                if inner { (v / grain as f32).round() as i32 * grain } else { v.round() as i32 }
            };
            let (x, y) = (place(i, across, moved.x, sides[0]), place(j, down, moved.y, sides[1]));
            vertices.push([x + shear * y, y]);
        }
    }
    let at = |i: u32, j: u32| vertices[(j * (across + 1) + i) as usize];
    let mut triangles = Vec::new();
    for j in 0..down {
        for i in 0..across {
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

/// From cells of a hundred pixels down to one, vertices anywhere, and on pixel centres and corners, where edges pass through samples; then slivers, upright,
/// lying and slanted, down to an eighth of a pixel wide.
const NETS: [Net; 11] = [
    Net { n: [5, 5], grain: 1, shear: 0 },
    Net { n: [37, 37], grain: 128, shear: 0 },
    Net { n: [64, 64], grain: 256, shear: 0 },
    Net { n: [150, 150], grain: 1, shear: 0 },
    Net { n: [150, 150], grain: 128, shear: 0 },
    Net { n: [250, 250], grain: 64, shear: 0 },
    Net { n: [400, 400], grain: 1, shear: 0 },
    Net { n: [4000, 12], grain: 1, shear: 0 },
    Net { n: [9, 2000], grain: 1, shear: 0 },
    Net { n: [4000, 9], grain: 1, shear: 3 },
    Net { n: [1500, 16], grain: 16, shear: 7 },
];

fn is_in_picture(v: &[[i32; 2]; 3]) -> bool {
    let half = SIDE as i32 * 128;
    (0..2).all(|k| v.iter().any(|p| p[k] > -half) && v.iter().any(|p| p[k] < half))
}

/// How many times longer a triangle is than it is high over its longest side.
fn slenderness(v: &[[i32; 2]; 3]) -> f64 {
    let d = |i: usize| [0, 1].map(|k| f64::from(v[(i + 1) % 3][k] - v[i][k]));
    let longest_2 = (0..3).map(|i| d(i)[0].powi(2) + d(i)[1].powi(2)).fold(0.0, f64::max);
    longest_2 / (d(0)[0] * d(1)[1] - d(0)[1] * d(1)[0]).abs().max(1.0)
}

#[test]
fn a_million_shared_edges_leave_no_crack_and_draw_nothing_twice() {
    let (mut n_edges, mut n_slivers) = (0, 0);
    for (i, net) in NETS.into_iter().enumerate() {
        let triangles = triangles_of(net, 0.15, i as u64);
        n_edges += triangles.iter().filter(|t| is_in_picture(t)).count() * 3 / 2;
        n_slivers += triangles.iter().filter(|t| is_in_picture(t) && slenderness(t) > 50.0).count();
        for path in [CpuPath::Portable, CpuPath::detect()] {
            let mut counts = vec![0; (SIDE * SIDE) as usize];
            triangles.iter().for_each(|t| add(&mut counts, path, *t));
            let [never, _, often] = tally(&counts);
            assert_eq!((never, often), (0, 0), "{net:?}, {path}");
        }
    }
    assert!(n_edges > 1_000_000 && n_slivers > 100_000, "{n_edges} edges, {n_slivers} slivers");
}

/// What is seen at every sample of a tile when triangles at one depth are drawn in their order.
fn drawn<'a>(path: CpuPath, triangles: impl Iterator<Item = &'a Triangle>, tile: &Tile) -> Vec<u32> {
    let mut buffer = ItemBuffer::default();
    triangles.for_each(|t| buffer.draw(path, t, tile, t.face));
    buffer.items().to_vec()
}

/// Samples of a net, sorted into tiles and drawn: those that show nothing, and those that show another triangle when the last is drawn first. Of what lies at one
/// depth the first wins, so these were drawn twice.
fn draw_in_tiles(path: CpuPath, net: &[[[i32; 2]; 3]], last: usize) -> [usize; 2] {
    let grid = Grid::bands(SIDE, SIDE, 0).next().expect("there is a picture");
    let of_net = |i: u32| Triangle::new(net[i as usize], i);
    let bins = Bins::build(&grid, last as u32, |range, out| out.extend(range.filter_map(of_net)));
    let mut tally = [0; 2];
    for i in 0..grid.n_tiles() {
        let (x, y) = grid.corner(i);
        let tile = Tile::of_picture(x, y, SIDE, SIDE, [0.0; 2]);
        let triangles = bins.of_tile(&grid, i);
        let (forth, back) = (drawn(path, triangles.iter().copied(), &tile), drawn(path, triangles.iter().rev().copied(), &tile));
        tally[0] += forth.iter().filter(|item| **item == NOTHING).count();
        tally[1] += forth.iter().zip(&back).filter(|(a, b)| a != b).count();
    }
    tally
}

#[test]
fn tiles_draw_every_sample_of_such_nets_once() {
    for (i, net) in NETS.into_iter().enumerate() {
        let mut triangles = triangles_of(net, 0.15, i as u64);
        let n = triangles.len();
        for path in [CpuPath::Portable, CpuPath::detect()] {
            assert_eq!(draw_in_tiles(path, &triangles, n), [0, 0], "{net:?}, {path}");
        }
        // The twins: with one triangle too few, of those that are seen, and with one more beneath the others.
        let Some(large) = triangles.iter().position(|t| is_in_picture(t) && slenderness(t) < 4.0) else { continue };
        if net.n[0] < 100 {
            let again = triangles[large];
            triangles.push(again);
            assert!(draw_in_tiles(CpuPath::detect(), &triangles, n + 1)[1] > 0, "{net:?}");
            triangles.swap(large, n - 1);
            assert!(draw_in_tiles(CpuPath::detect(), &triangles, n - 1)[0] > 0, "{net:?}");
        }
    }
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
    let triangles = triangles_of(Net { n: [64, 64], grain: 128, shear: 0 }, 0.15, 1);
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
