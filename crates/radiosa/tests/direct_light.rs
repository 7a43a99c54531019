//! What lights that are no surfaces bring to elements and sensors of radiosity, against closed forms.

mod common;

use std::fmt::Write as _;

use common::{below, scene_of, world_of};
use radiosa::emitter::environment::{Map, Sky};
use radiosa::math::{DVec3, Vec3};
use radiosa::radiosity::gather::{Gather, Scratch};
use radiosa::radiosity::mesh::{self, ElementMesh};
use radiosa::radiosity::{self, Solution};
use radiosa::scene::{Environment, EnvironmentRadiance, Image, ImageId, Pixels};
use radiosa::spectrum::Spectrum;
use radiosa::transport::World;

fn solved(world: &World, elements: u32) -> Solution {
    let mut settings = radiosity::Settings::default();
    (settings.mesh.elements, settings.refine.levels) = (elements, 0);
    radiosity::solve(world, &settings)
}

/// Mean irradiance by area of the elements that face up, first channel.
fn mean_above(solution: &Solution) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for (element, h) in solution.mesh.elements().iter().zip(&solution.irradiance).filter(|(e, _)| e.normal.y > 0.5) {
        sum += element.area * h[0];
        area += element.area;
    }
    sum / area
}

#[test]
fn a_sun_in_an_environment_map_lights_every_element_and_sensor() {
    // One texel of 128 × 64 gives nearly all the light: rays by the cosine find it once in some thousand.
    const SIZE: [u32; 2] = [128, 64];
    let mut texels = vec![0.2f32; (4 * SIZE[0] * SIZE[1]) as usize];
    let sun = 4 * (12 * SIZE[0] + 40) as usize;
    texels[sun..sun + 3].fill(20_000.0);
    let mut scene = scene_of(
        "[material.a]\nlambert = 0.5\n[[shape]]\nname = \"floor\"\nmaterial = \"a\"\nquad = [[0, 0, 0], [0, 0, 2], [2, 0, 2], [2, 0, 0]]\n",
    );
    let image = Image { name: "sun".into(), width: SIZE[0], height: SIZE[1], pixels: Pixels::Rgba32F(texels.into()) };
    let truth = Sky::of_map(Map::from_image(&image, Spectrum::WHITE).expect("it has pixels")).irradiance(DVec3::Y)[0];
    scene.images.push(image);
    scene.environment = Some(Environment { radiance: EnvironmentRadiance::Map(ImageId(0)), ..Environment::default() });
    let world = world_of(scene);
    let solution = solved(&world, 100);
    for (element, h) in solution.mesh.elements().iter().zip(&solution.irradiance).filter(|(e, _)| e.normal.y > 0.5) {
        assert!((h[0] / truth - 1.0).abs() < 0.05, "{:?}: {} for {truth}", element.centre(), h[0]);
    }
    let mean = mean_above(&solution);
    assert!((mean / truth - 1.0).abs() < 0.01, "{mean} for {truth}");
    let gather = Gather::new(&world, &solution, &[], 0);
    let surface = below(&world, Vec3::new(0.7, 0.0, 1.1), Vec3::Y);
    let (mut off, mut errors, mut scratch) = (0.0, 0.0, Scratch::default());
    for sensor in 0..16 {
        let at = gather.at(&surface, Vec3::Y, sensor, &mut scratch);
        off += (f64::from(at.irradiance.g) - truth).powi(2);
        errors += at.standard_error.powi(2);
    }
    println!("sensors are off by {:.3} of {truth:.3}, and say {:.3}", (off / 16.0).sqrt(), (errors / 16.0).sqrt());
    // (Its rays are spread more evenly than the error they state takes them to be.)
    assert!(off <= errors && errors / 16.0 < (0.05 * truth).powi(2));
}

#[test]
fn light_is_averaged_over_area_on_elements_that_are_no_parallelograms() {
    // A trapezium of one element, all of whose area lies towards its broad end, and a lamp over its point.
    let text = "[material.a]\nlambert = 0.5\n[[shape]]\nname = \"floor\"\nmaterial = \"a\"\nquad = [[-0.05, 0, 0], [-1, 0, 4], [1, 0, 4], [0.05, 0, 0]]\n\
        [light.l]\npoint = [0, 1, 0]\nunit = \"physical\"\nintensity = 10\n";
    let world = world_of(scene_of(text));
    let mut settings = radiosity::Settings::default();
    (settings.mesh.elements, settings.refine.levels) = (0, 0);
    let solution = radiosity::solve(&world, &settings);
    // E = I h/r³ over rows of the trapezium, of width 2 (0.05 + 0.95 z/4).
    let (mut weighted, mut area, mut plain) = (0.0, 0.0, 0.0);
    const N: u32 = 400;
    for j in 0..N {
        let t = (f64::from(j) + 0.5) / f64::from(N);
        let half = 0.05 + 0.95 * t;
        for i in 0..N {
            let x = half * (2.0 * (f64::from(i) + 0.5) / f64::from(N) - 1.0);
            let e = 10.0 / (x * x + 1.0 + (4.0 * t).powi(2)).powf(1.5);
            weighted += half * e;
            area += half;
            plain += e / f64::from(N * N);
        }
    }
    let (truth, found) = (weighted / area, mean_above(&solution));
    println!("{found} for {truth}, over the unit square {plain}");
    assert!((found / truth - 1.0).abs() < 0.05, "{found} for {truth}");
    // The twin takes points of the unit square as they are.
    assert!(plain / truth > 1.3);
}

#[test]
fn slats_take_the_part_of_a_sun_that_they_cover() {
    // They cover a tenth of the sky: four points of an element see none of them more often than not.
    let mut text = "[material.a]\nlambert = 0\n[[shape]]\nname = \"floor\"\nmaterial = \"a\"\nquad = [[0, 0, 0], [0, 0, 2], [2, 0, 2], [2, 0, 0]]\n\
        [light.sun]\ndistant = { to_light = [0, 1, 0] }\nunit = \"physical\"\nintensity = 1000\n"
        .to_owned();
    for k in -10..60 {
        let (x0, x1) = (0.05 * f64::from(k), 0.05 * f64::from(k) + 0.005);
        // Writing to a string cannot fail.
        let _ = write!(text, "[[shape]]\nmaterial = \"a\"\nquad = [[{x0}, 1, -1], [{x0}, 1, 3], [{x1}, 1, 3], [{x1}, 1, -1]]\n");
    }
    let world = world_of(scene_of(&text));
    let mut settings = radiosity::Settings::default();
    (settings.mesh.size, settings.refine.levels) = (Some(0.1), 0);
    let solution = radiosity::solve(&world, &settings);
    let floor = |e: &mesh::Element| e.normal.y > 0.5 && e.centre().y.abs() < 0.1;
    let (mut sum, mut n) = (0.0, 0);
    for (_, h) in solution.mesh.elements().iter().zip(&solution.irradiance).filter(|(e, _)| floor(e)) {
        sum += h[0];
        n += 1;
    }
    let mean = sum / f64::from(n);
    println!("{mean} for 900 over {n} elements");
    assert!((mean / 900.0 - 1.0).abs() < 0.03, "{mean}");
}

#[test]
fn a_mesh_is_made_again_where_sheets_lie_in_a_row_in_one_plane() {
    // Each covers a part of the next; a block hides the first two, and light that reaches the third must not come to them, one more each time the mesh is made.
    let sheet = |x: [f64; 2]| {
        let [a, b] = x;
        format!("[[shape]]\nmaterial = \"a\"\nquad = [[{a}, 0, 0], [{a}, 0, 1], [{b}, 0, 1], [{b}, 0, 0]]\n")
    };
    let text = "[material.a]\nlambert = 0.5\n[light.l]\npoint = [2.5, 2, 0.5]\nunit = \"physical\"\nintensity = 10\n".to_owned()
        + &[[0.0, 1.0], [0.5, 1.5], [1.4, 3.0]].map(sheet).concat()
        + "[[shape]]\nmaterial = \"a\"\nbox = { min = [-0.1, -0.1, -0.1], max = [1.6, 0.5, 1.1] }\n";
    let world = world_of(scene_of(&text));
    let solution = solved(&world, 400);
    let again = ElementMesh::again(&world, solution.mesh.record()).expect("the same surfaces");
    assert_eq!(again.elements(), solution.mesh.elements());
    assert!(solution.mesh.coincident().len() >= 2);
}
