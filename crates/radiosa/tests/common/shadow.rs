//! A square light, a blocker, a floor: how far the floor's irradiance is off the closed form, by meshes with and without the borders of shadows.
#![allow(dead_code, reason = "the test and the example that measures each ask for a part")]

use std::path::Path;

use radiosa::math::{CpuPath, DVec3, Ray, Vec3};
use radiosa::radiosity::display::{self, Display};
use radiosa::radiosity::mesh::{self, Element, ElementMesh};
use radiosa::radiosity::{self, Division, Radiosity, Side, Solution};
use radiosa::transport::{Footprint, Solver as _, Step, World};
use radiosa_testkit::shadow::{V, point_to_polygon_past};

/// Half the floor, and the radiosity of the light.
const HALF: f64 = 2.0;
const LIGHT: f64 = 40.0 * std::f64::consts::PI;
/// Places on a side of the floor where irradiance is compared.
const PLACES: u32 = 400;

/// What the scene is made of: a square light 2 m and a square blocker 1 m above the middle of the floor.
pub(crate) struct Shadow {
    pub(crate) name: &'static str,
    light: [V; 4],
    blocker: [V; 4],
    pub(crate) world: World,
}

fn square(y: f64, side: f64, degrees: f64) -> [V; 4] {
    let (s, c) = degrees.to_radians().sin_cos();
    [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(|[x, z]| {
        let (x, z) = (0.5 * side * x, 0.5 * side * z);
        [x * c + z * s, y, z * c - x * s]
    })
}

impl Shadow {
    pub(crate) fn new(name: &'static str, light: f64, degrees: f64) -> Self {
        let (blocker, mut light) = (square(1.0, 0.8, degrees), square(2.0, light, 0.0));
        // (It shines down.)
        light.reverse();
        let text = format!(
            "[material.floor]\nlambert = 0.7\n[material.blocker]\nlambert = 0\n[material.light]\nlambert = 0\nemission = 40\n\
             [[shape]]\nname = \"floor\"\nmaterial = \"floor\"\nquad = {:?}\n\
             [[shape]]\nname = \"blocker\"\nmaterial = \"blocker\"\nquad = {blocker:?}\n\
             [[shape]]\nname = \"light\"\nmaterial = \"light\"\nquad = {light:?}\n",
            square(0.0, 2.0 * HALF, 0.0)
        );
        let scene = radiosa::import::load_bytes(text.as_bytes(), Path::new("shadow.toml"), &Default::default());
        let world = World::prepare(scene.expect("it is a scene").0, CpuPath::detect()).expect("it is valid");
        Self { name, light, blocker, world }
    }

    /// The irradiance at a point of the floor, exactly.
    pub(crate) fn irradiance(&self, x: f64, z: f64) -> f64 {
        LIGHT * point_to_polygon_past([x, 0.0, z], [0.0, 1.0, 0.0], &self.light, &self.blocker)
    }

    fn is_floor(&self, mesh: &ElementMesh, element: &Element) -> bool {
        let instance = mesh.patches()[element.patch as usize].instance;
        self.world.scene().instances[instance.index()].name == "floor" && element.side == Side::Front
    }

    /// Elements of the floor.
    pub(crate) fn n(&self, mesh: &ElementMesh) -> usize {
        mesh.elements().iter().filter(|e| self.is_floor(mesh, e)).count()
    }

    /// Solved over elements of a size.
    pub(crate) fn solve(&self, size: f64, discontinuities: u32, refine: Refine) -> Solution {
        radiosity::solve(&self.world, &settings(size, discontinuities, refine))
    }

    /// The same with every border of a shadow moved aside.
    pub(crate) fn solve_moved(&self, size: f64, by: DVec3) -> Solution {
        let settings = settings(size, 1, Refine::default());
        let mut record = Division::new(&self.world, &settings).mesh().record().clone();
        record.exposed.clear();
        record.shadows.lines.iter_mut().for_each(|line| line.ends = line.ends.map(|p| p + by));
        let mesh = ElementMesh::again(&self.world, &record).expect("it is of this world");
        let division = Division::of(mesh, &settings.solver);
        let mut radiosity = Radiosity::new(&self.world, &division, &settings);
        while let Step::Working { .. } = radiosity.step(&self.world) {}
        radiosity.into_solution()
    }

    /// How far it is off.
    pub(crate) fn errors(&self, solution: &Solution) -> Errors {
        const PARTS: u32 = 12;
        let mesh = &solution.mesh;
        let (mut of_elements, mut all, mut n) = (0.0, 0.0, 0);
        for (element, h) in mesh.elements().iter().zip(&solution.irradiance) {
            if !self.is_floor(mesh, element) {
                continue;
            }
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(PARTS);
            let places = (0..PARTS * PARTS).map(|k| element.at([at(k % PARTS), at(k / PARTS)]));
            let mean = places.map(|p| self.irradiance(p.x, p.z)).sum::<f64>() / f64::from(PARTS * PARTS);
            of_elements += element.whole_area * (h[1] - mean).abs();
            all += element.whole_area * mean;
            n += 1;
        }
        let display = Display::new(&self.world, solution, &[], display::Settings::default(), Footprint::default());
        let (mut flat, mut shown, mut sum) = (0.0, 0.0, 0.0);
        for k in 0..PLACES * PLACES {
            let [x, z] = [k % PLACES, k / PLACES].map(|i| HALF * (2.0 * (f64::from(i) + 0.5) / f64::from(PLACES) - 1.0));
            let truth = self.irradiance(x, z);
            let ray = Ray::new(Vec3::new(x as f32, 0.01, z as f32), -Vec3::Y);
            let (hit, surface) = self.world.closest_visible(&ray).expect("the floor");
            let element = mesh.element_at(&hit, surface.p, ray.dir).expect("an element");
            flat += (solution.irradiance[element as usize][1] - truth).abs();
            let h = display.irradiance_at(&hit, surface.p, ray.dir).expect("an element");
            shown += (f64::from(h.g) - truth).abs();
            sum += truth;
        }
        Errors { n, of_elements: of_elements / all, flat: flat / sum, shown: shown / sum }
    }
}

/// L1 errors, relative to the irradiance of the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Errors {
    /// Elements of the floor.
    pub(crate) n: usize,
    /// Of elements, against exact means over them.
    pub(crate) of_elements: f64,
    /// At points, by one value an element.
    pub(crate) flat: f64,
    /// At points, as pictures show it.
    pub(crate) shown: f64,
}

/// Adaptive refinement: how often, and up to how many elements in all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Refine {
    pub(crate) levels: u32,
    pub(crate) elements: usize,
}

fn settings(size: f64, discontinuities: u32, refine: Refine) -> radiosity::Settings {
    radiosity::Settings {
        mesh: mesh::Settings { size: Some(size), discontinuities, ..Default::default() },
        refine: radiosity::refine::Settings {
            levels: refine.levels,
            elements: refine.elements,
            threshold: 0.01,
            ..Default::default()
        },
        ..Default::default()
    }
}

/// The smallest number for which something has at least `wanted`, by halving; it must grow with the number.
pub(crate) fn least(mut low: f64, mut high: f64, wanted: usize, n: impl Fn(f64) -> usize) -> f64 {
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if n(middle) >= wanted { high = middle } else { low = middle }
    }
    high
}

/// As many equal elements as wanted, or a few more: the edges of `1/size` metres.
pub(crate) fn uniform(of: &Shadow, wanted: usize) -> Solution {
    let side = (wanted as f64).sqrt().ceil();
    of.solve(2.0 * HALF / side, 0, Refine::default())
}

/// As many elements as wanted, or a few more, of a quadtree over cells of a size.
pub(crate) fn adaptive(of: &Shadow, size: f64, levels: u32, wanted: usize) -> Solution {
    let solve = |elements: f64| of.solve(size, 0, Refine { levels, elements: elements as usize });
    let most = least(wanted as f64 * 0.5, wanted as f64 * 8.0, wanted, |elements| of.n(&solve(elements).mesh));
    solve(most)
}
