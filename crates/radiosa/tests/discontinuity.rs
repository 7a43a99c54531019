//! Discontinuity meshing: lines where they must be, errors against the closed form, and meshes that cover everything once whatever the scene.

mod common;
#[path = "common/shadow.rs"]
mod shadow;

use std::fmt::Write as _;

use common::{scene_of, world_of};
use radiosa::math::{DVec3, Ray, Vec3};
use radiosa::radiosity::direct::DirectLight;
use radiosa::radiosity::discontinuity::Line;
use radiosa::radiosity::mesh::{self, ElementMesh};
use radiosa::transport::World;
use shadow::{Refine, Shadow, adaptive, uniform};

fn mesh(world: &World, size: f64, discontinuities: u32) -> ElementMesh {
    let settings = mesh::Settings { size: Some(size), discontinuities, ..Default::default() };
    ElementMesh::new(world, &settings, &DirectLight::new(world, &[], 0))
}

fn lines(mesh: &ElementMesh) -> &[Line] {
    &mesh.record().shadows.lines
}

#[test]
fn a_shadow_has_less_error_where_its_borders_are_borders_of_elements() {
    for (of, least) in [(Shadow::new("small light", 0.1, 25.0), 4.0), (Shadow::new("aligned", 0.5, 0.0), 2.0)] {
        let size = 0.2;
        let by_lines = of.errors(&of.solve(size, 1, Refine::default()));
        let others = [of.errors(&uniform(&of, by_lines.n)), of.errors(&adaptive(&of, 2.0 * size, 2, by_lines.n))];
        let moved = of.errors(&of.solve_moved(size, DVec3::new(0.5, 0.0, 0.5) * size));
        println!("{}: {by_lines:?}, without: {others:?}, moved: {moved:?}", of.name);
        for other in others {
            assert!(other.n >= by_lines.n && other.shown > least * by_lines.shown, "{other:?}");
            assert!(other.of_elements > by_lines.of_elements, "{other:?}");
        }
        // The twin: lines, but not where the shadow ends.
        assert!(moved.shown > least * by_lines.shown, "{moved:?}");
    }
}

/// A square of 1 m, 1 m above a floor of 8 m, with something above.
fn under(light: &str) -> World {
    let text = format!(
        "[material.a]\nlambert = 0.5\n\
         [[shape]]\nname = \"floor\"\nmaterial = \"a\"\nquad = [[-4, 0, -4], [-4, 0, 4], [4, 0, 4], [4, 0, -4]]\n\
         [[shape]]\nmaterial = \"a\"\nquad = [[-0.5, 1, -0.5], [-0.5, 1, 0.5], [0.5, 1, 0.5], [0.5, 1, -0.5]]\n{light}"
    );
    world_of(scene_of(&text))
}

/// The lines run along the borders of a square of the floor.
fn are_of_square(lines: &[Line], x: [f64; 2], z: [f64; 2]) -> bool {
    let is_near = |a: f64, b: f64| (a - b).abs() < 1e-3;
    let is_side = |line: &Line| {
        let [a, b] = line.ends;
        let along = |u: [f64; 2], v: [f64; 2], [low, high]: [f64; 2], at: [f64; 2]| {
            let is_whole = is_near(v[0].min(v[1]), low) && is_near(v[0].max(v[1]), high);
            is_whole && is_near(u[0], u[1]) && at.iter().any(|at| is_near(u[0], *at))
        };
        along([a.x, b.x], [a.z, b.z], z, x) || along([a.z, b.z], [a.x, b.x], x, z)
    };
    lines.len() == 4 && lines.iter().all(is_side)
}

#[test]
fn lamps_cast_shadows_with_the_borders_they_must_have() {
    let of = |world: &World| lines(&mesh(world, 0.25, 4)).to_vec();
    let point = of(&under("[light.a]\npoint = [0.25, 3, 0]\nintensity = 1\n"));
    // From three metres up everything at one metre looks one and a half times as large.
    assert!(are_of_square(&point, [-0.875, 0.625], [-0.75, 0.75]), "{point:?}");
    let sun = of(&under("[light.a]\ndistant = { to_light = [0.6, 0.8, 0] }\nintensity = 1\n"));
    assert!(are_of_square(&sun, [-1.25, -0.25], [-0.5, 0.5]), "{sun:?}");
    assert!(!are_of_square(&sun, [-1.2, -0.2], [-0.5, 0.5]) && !are_of_square(&point, [-0.5, 0.5], [-0.5, 0.5]));
    // A light without size does what lines bound: on either side elements are wholly lit or dark.
    let world = under("[light.a]\ndistant = { to_light = [0.6, 0.8, 0] }\nintensity = 1\n");
    for (n, dim) in [(0, true), (4, false)] {
        let mesh = mesh(&world, 0.3, n);
        let [h, _] = DirectLight::new(&world, &[], 0).irradiance(&mesh);
        let whole = h.iter().map(|h| h[1]).fold(0.0, f64::max);
        assert_eq!(h.iter().any(|h| h[1] > 0.02 * whole && h[1] < 0.98 * whole), dim, "{n}");
    }
    // Behind what is not transparent nothing more begins.
    let behind = of(&under(
        "[light.a]\npoint = [0, 3, 0]\nintensity = 1\n[[shape]]\nmaterial = \"a\"\nquad = [[-1, 2.9, -1], [-1, 2.9, 1], [1, 2.9, 1], [1, 2.9, -1]]\n",
    ));
    assert!(behind.is_empty(), "{behind:?}");
}

#[test]
fn penumbrae_of_parallel_squares_have_the_lines_they_must_have() {
    let light = |y: f64| {
        format!(
            "[material.l]\nlambert = 0\nemission = 9\n[[shape]]\nmaterial = \"l\"\nquad = [[-0.25, {y}, -0.25], [0.25, {y}, -0.25], [0.25, {y}, 0.25], [-0.25, {y}, 0.25]]\n"
        )
    };
    let found = lines(&mesh(&under(&light(2.0)), 0.2, 1)).to_vec();
    // Penumbra from 0.75 to 1.25 m, from corners of the light and from edges alike.
    let is_at = |x: f64| [-1.25, -0.75, 0.75, 1.25].iter().any(|at| (x - at).abs() < 2e-3);
    let parallel = |line: &Line| {
        let [a, b] = line.ends;
        ((a.x - b.x).abs() < 1e-3 && is_at(a.x)) || ((a.z - b.z).abs() < 1e-3 && is_at(a.z))
    };
    assert!(found.len() >= 16 && found.iter().all(parallel), "{found:?}");
    for x in [-1.25, -0.75, 0.75, 1.25] {
        assert!(found.iter().any(|line| line.ends.iter().all(|p| (p.x - x).abs() < 2e-3)), "{x}");
    }
    assert!(lines(&mesh(&under(&light(2.0)), 0.2, 0)).is_empty());
    assert!(lines(&mesh(&under(&light(0.5)), 0.2, 1)).is_empty(), "nothing stands below it");
}

/// Scenes of squares and boxes by a number: through each other, in one plane, as thin as nothing, far from the origin.
fn hostile(seed: u64) -> String {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut number = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        // On a coarse grid half of the time, so that things coincide.
        let x = (state >> 40) as f64 / f64::from(1 << 24);
        if state & 1 == 0 { (x * 4.0).floor() / 4.0 } else { x }
    };
    let scale = [1.0, 1e-3, 1e4][seed as usize % 3];
    let away = [0.0, 3e3][seed as usize % 2] * scale;
    let mut text = String::from(
        "[material.a]\nlambert = 0.5\n[material.l]\nlambert = 0.2\nemission = 10\n[light.p]\npoint = [0.5, 1.5, 0.5]\nintensity = 1\n",
    );
    for k in 0..14 {
        let material = if k % 5 == 0 { "l" } else { "a" };
        let mut at = || -> [f64; 3] { std::array::from_fn(|_| number() * 2.0 * scale + away) };
        let [p, q, r] = [at(), at(), at()];
        let low: [f64; 3] = std::array::from_fn(|i| p[i].min(q[i]));
        let high: [f64; 3] = std::array::from_fn(|i| p[i].max(q[i]) + if k % 4 == 0 { 1e-7 * scale } else { 0.05 * scale });
        // (Slivers, but no faces without area, which are refused.)
        let r: [f64; 3] = std::array::from_fn(|i| r[i] + [1e-5, 2e-5, -3e-5][i] * scale);
        let corner: [f64; 3] = std::array::from_fn(|i| p[i] + r[i] - q[i]);
        let shape = if k % 2 == 0 {
            format!("box = {{ min = {low:?}, max = {high:?} }}")
        } else {
            format!("quad = [{p:?}, {q:?}, {r:?}, {corner:?}]")
        };
        writeln!(text, "[[shape]]\nmaterial = \"{material}\"\n{shape}").expect("it is a string");
    }
    text
}

#[test]
fn elements_cover_everything_once_whatever_the_scene() {
    let mut n_lines = 0;
    for seed in 0..24u64 {
        let world = world_of(scene_of(&hostile(seed)));
        let settings = |discontinuities| mesh::Settings { elements: 400, discontinuities, ..Default::default() };
        let direct = DirectLight::new(&world, &[], 0);
        let [plain, cut] = [0, 8].map(|n| ElementMesh::new(&world, &settings(n), &direct));
        n_lines += lines(&cut).len();
        let area = |mesh: &ElementMesh| mesh.elements().iter().map(|e| e.whole_area).sum::<f64>();
        assert!((area(&cut) - area(&plain)).abs() <= 1e-9 * area(&plain), "{seed}: {} is not {}", area(&cut), area(&plain));
        assert!(cut.elements().iter().all(|e| e.corners().iter().all(|c| c.is_finite())), "{seed}");
        assert!(cut.elements().len() <= 3 * plain.elements().len() + 64, "{seed}: {}", cut.elements().len());
        // The element found at a point has it.
        for (i, element) in cut.elements().iter().enumerate().step_by(7) {
            let p = element.centre();
            let found = cut.element_on(element.patch, element.side, p).expect("an element");
            let other = &cut.elements()[found as usize];
            let close = (other.centre() - p).length() <= 1e-6 * (p.length() + 1.0);
            let replaced = other.patch != element.patch;
            assert!(found as usize == i || replaced || close || element.whole_area < 1e-9 * area(&cut), "{seed}: {i}, {found}");
        }
        // Made again without a ray, it is the same.
        let again = ElementMesh::again(&world, cut.record()).expect("it is of this world");
        assert!(again.elements() == cut.elements() && again.record() == cut.record(), "{seed}");
    }
    assert!(n_lines > 100, "{n_lines} lines in all");
}

#[test]
fn the_same_lines_at_any_thread_count() {
    let world = world_of(scene_of(&hostile(6)));
    let of = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads");
        pool.install(|| mesh(&world, 0.2, 8).record().shadows.clone())
    };
    let one = of(1);
    assert!(!one.lines.is_empty() && [2, 5].into_iter().all(|n| of(n) == one));
}

#[test]
fn few_elements_take_the_strongest_lines_and_say_how_many_are_left() {
    let world = Shadow::new("turned", 0.5, 25.0).world;
    let of = |elements| {
        let settings = mesh::Settings { elements, discontinuities: 1, ..Default::default() };
        ElementMesh::new(&world, &settings, &DirectLight::new(&world, &[], 0)).record().shadows.clone()
    };
    let (few, many) = (of(16), of(4000));
    assert!(few.lines.len() < many.lines.len() && few.n_left_out > 0 && many.n_left_out == 0, "{few:?}");
    assert!(few.lines.is_sorted_by(|a, b| a.strength >= b.strength));
}

#[test]
fn rays_find_elements_on_either_side_of_a_line() {
    let of = Shadow::new("turned", 0.1, 25.0);
    let mesh = mesh(&of.world, 0.3, 1);
    for line in lines(&mesh) {
        let middle = (line.ends[0] + line.ends[1]) * 0.5;
        let across = (line.ends[1] - line.ends[0]).cross(DVec3::Y).normalize_or_zero() * 0.02;
        let at = |p: DVec3| {
            let ray = Ray::new(Vec3::new(p.x as f32, 0.01, p.z as f32), -Vec3::Y);
            let (hit, surface) = of.world.closest_visible(&ray).expect("the floor");
            mesh.element_at(&hit, surface.p, ray.dir).expect("an element")
        };
        assert_ne!(at(middle + across), at(middle - across), "{line:?}");
    }
}
