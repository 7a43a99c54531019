//! Every routine that draws points, directions or facets against its density, by χ², each with a wrong twin that is caught. Reflection functions as wholes are in
//! `scatter.rs` and `rough_glass.rs`, environment maps beside their sampler.
#![expect(clippy::print_stdout, reason = "tests say what they measured")]

mod common;

use std::f64::consts::{PI, TAU};

use common::chi_square::{Cells, chi_square};
use common::{scene_of, world_of};

use radiosa::bsdf::microfacet::{self, Angles};
use radiosa::bsdf::{Bsdf, FactorsOnly};
use radiosa::emitter::random::{Met, PointSampler};
use radiosa::math::{Ray, Vec2, Vec3};
use radiosa::sampling::{Stream, warp};
use radiosa::scene::{self, Distribution, Fresnel, Shadowing};
use radiosa::spectrum::Spectrum;

const N: u32 = 200_000;
/// Once in 10⁹ by chance.
const LIMIT: f64 = 6.0;

/// χ² of directions on the sphere, over cells of height and longitude.
fn of_directions(draw: impl Fn(&mut Stream) -> Option<Vec3>, pdf: impl Fn(Vec3) -> f32) -> f64 {
    Cells { lowest: -1.0, rows: 24, columns: 24, fine: 32 }.chi_square(N, draw, pdf).0
}

/// Of points on the unit square, over square cells.
fn of_points(draw: impl Fn(Vec2) -> Vec2, pdf: impl Fn(Vec2) -> f32) -> f64 {
    const SIDE: usize = 20;
    const FINE: usize = 16;
    let mut expected = vec![0.0; SIDE * SIDE];
    for (k, e) in expected.iter_mut().enumerate() {
        for i in 0..FINE * FINE {
            let at = |whole: usize, fine: usize| ((whole as f64 + (fine as f64 + 0.5) / FINE as f64) / SIDE as f64) as f32;
            let p = Vec2::new(at(k / SIDE, i / FINE), at(k % SIDE, i % FINE));
            *e += f64::from(pdf(p)) * f64::from(N) / (SIDE * SIDE * FINE * FINE) as f64;
        }
    }
    let mut count = vec![0.0; SIDE * SIDE];
    let mut stream = Stream::new(8, 6, 7);
    for _ in 0..N {
        let p = draw(stream.next_2d());
        let cell = |x: f32| ((f64::from(x) * SIDE as f64) as usize).min(SIDE - 1);
        count[cell(p.x) * SIDE + cell(p.y)] += 1.0;
    }
    chi_square(&expected, &count).0
}

/// The routine follows its density, and another density is caught.
fn check(name: &str, z: f64, twin: f64) {
    println!("{name}: z {z:.2}, twin {twin:.1}");
    assert!(z < LIMIT, "{name}: z {z}");
    assert!(twin > LIMIT, "{name}: the twin is not caught, z {twin}");
}

#[test]
fn directions_around_an_axis_follow_their_density() {
    let everywhere = |_: Vec3| (1.0 / (4.0 * PI)) as f32;
    let cosine = |s: &mut Stream| Some(warp::cosine_hemisphere(s.next_2d()));
    let above = |w: Vec3, pdf: f32| if w.z > 0.0 { pdf } else { 0.0 };
    let uniform = |w: Vec3| above(w, warp::uniform_hemisphere_pdf(w));
    check("cosine", of_directions(cosine, |w| above(w, warp::cosine_hemisphere_pdf(w))), of_directions(cosine, uniform));
    let half = |s: &mut Stream| Some(warp::uniform_hemisphere(s.next_2d()));
    let sphere = |s: &mut Stream| Some(warp::uniform_sphere(s.next_2d()));
    check("hemisphere", of_directions(half, uniform), of_directions(half, |w| above(w, warp::cosine_hemisphere_pdf(w))));
    check("sphere", of_directions(sphere, everywhere), of_directions(sphere, |w| (1.0 + 0.1 * w.z) * everywhere(w)));
    // Cones end between two rows of cells.
    for cos in [0.0f32, 0.5, -0.5] {
        let cone = |s: &mut Stream| Some(warp::uniform_cone(s.next_2d(), cos));
        let pdf = |cos: f32| move |w: Vec3| if w.z >= cos { warp::uniform_cone_pdf(w, cos) } else { 0.0 };
        check(&format!("cone {cos}"), of_directions(cone, pdf(cos)), of_directions(cone, pdf(cos - 0.02)));
    }
}

#[test]
fn points_follow_their_density() {
    // Of the disc by the square of the radius and the angle, of the triangle by the map that is even over it.
    let disc = |u| {
        let p = warp::uniform_disc(u);
        let turn = f64::from(p.y).atan2(f64::from(p.x)).rem_euclid(TAU) / TAU;
        Vec2::new(p.length_squared(), turn as f32)
    };
    check("disc", of_points(disc, |_| 1.0), of_points(|u| Vec2::new(disc(u).x.sqrt(), disc(u).y), |_| 1.0));
    let triangle = |u| {
        let [a, b, _] = warp::uniform_triangle(u);
        Vec2::new((1.0 - a) * (1.0 - a), if a < 1.0 { b / (1.0 - a) } else { 0.5 })
    };
    check("triangle", of_points(triangle, |_| 1.0), of_points(|u| Vec2::new(triangle(u).x.sqrt(), triangle(u).y), |_| 1.0));
    let weights = [0.2, 1.0, 0.5, 3.0];
    let other = [0.2, 1.0, 0.7, 3.0];
    let bilinear = |u| warp::bilinear(weights, u).0;
    check(
        "bilinear",
        of_points(bilinear, |p| warp::bilinear_pdf(weights, p)),
        of_points(bilinear, |p| warp::bilinear_pdf(other, p)),
    );
}

#[test]
fn facets_follow_their_density() {
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for alpha in [0.3f32, 0.6, 1.0] {
            // As the viewer does not matter: D (n·h).
            let angles = |h: Vec3, wo: Vec3| {
                let tan2_h = (h.x * h.x + h.y * h.y) / (h.z * h.z);
                Angles { n_l: 1.0, n_v: wo.z, n_h: h.z, v_h: wo.dot(h), tan2_h }
            };
            let of_d = |alpha: f32| {
                move |h: Vec3| if h.z > 0.0 { microfacet::d(distribution, alpha, &angles(h, Vec3::Z)) * h.z } else { 0.0 }
            };
            let draw = |s: &mut Stream| Some(microfacet::sample_d(distribution, alpha, s.next_2d()));
            check(
                &format!("{distribution:?} {alpha}"),
                of_directions(draw, of_d(alpha)),
                of_directions(draw, of_d(alpha * 1.05)),
            );
            for theta in [0.0f32, 0.7, 1.3, 1.55] {
                for turn in [0.0f32, 2.5] {
                    let wo = Vec3::new(theta.sin() * turn.cos(), theta.sin() * turn.sin(), theta.cos());
                    let draw = |s: &mut Stream| Some(microfacet::sample_visible(distribution, alpha, wo, s.next_2d()));
                    let pdf = |alpha: f32| {
                        move |h: Vec3| {
                            let angles = angles(h, wo);
                            if h.z > 0.0 && angles.v_h > 0.0 {
                                microfacet::sample_visible_pdf(distribution, alpha, &angles)
                            } else {
                                0.0
                            }
                        }
                    };
                    let name = format!("visible {distribution:?} {alpha} at {theta}, turned by {turn}");
                    check(&name, of_directions(draw, pdf(alpha)), of_directions(draw, pdf(alpha * 1.1)));
                }
            }
        }
    }
}

#[test]
fn rough_reflections_of_whitteds_method_follow_their_density() {
    let bsdf = |distribution: Distribution, alpha: f32| {
        let model = scene::Model::CookTorrance(scene::CookTorrance {
            diffuse: scene::ColorMap::constant(Spectrum::BLACK),
            alpha: scene::ScalarMap::constant(alpha),
            distribution,
            shadowing: Shadowing::Smith,
            fresnel: Fresnel::One,
            ..scene::CookTorrance::default()
        });
        Bsdf::resolve(&scene::Material { model, ..scene::Material::default() }, &FactorsOnly)
    };
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for theta in [0.1f32, 0.8, 1.3] {
            let wo = Vec3::new(theta.sin(), 0.0, theta.cos());
            // Its weight is f (n·wi)/pdf.
            let of = bsdf(distribution, 0.4);
            let draw = |s: &mut Stream| of.sample_gloss(Vec3::Z, wo, s.next_2d()).map(|(wi, _)| wi);
            let pdf = |alpha: f32| {
                move |wi: Vec3| {
                    let density = |a: Angles| microfacet::d(distribution, alpha, &a) * a.n_h / (4.0 * a.v_h);
                    Angles::new(Vec3::Z, wo, wi).map_or(0.0, density)
                }
            };
            let mut stream = Stream::new(3, 2, 1);
            for _ in 0..1000 {
                if let Some((wi, weight)) = of.sample_gloss(Vec3::Z, wo, stream.next_2d()) {
                    let expected = of.evaluate_cos(Vec3::Z, wo, wi).specular.g / pdf(0.4)(wi);
                    assert!((weight.g / expected - 1.0).abs() < 1e-3, "{weight:?} for {expected}");
                }
            }
            let name = format!("gloss {distribution:?} at {theta}");
            check(&name, of_directions(draw, pdf(0.4)), of_directions(draw, pdf(0.43)));
        }
    }
}

#[test]
fn points_on_emissive_surfaces_follow_their_density() {
    let world = world_of(scene_of(
        r#"
[material.light]
emission = 1
two_sided = true
[material.bright]
emission = 5
[[shape]]
material = "light"
quad = [[-2, -1, 1.4], [1, -2, 1.4], [1.5, 0, 1.4], [-1.5, 0.5, 1.4]]
[[shape]]
material = "bright"
sphere = { center = [1.2, 1.5, 0.8], radius = 0.6 }
[[shape]]
material = "light"
disc = { center = [-1, 1.8, 0.5], normal = [0.3, -1, -0.4], radius = 0.7 }
"#,
    ));
    let sampler = PointSampler::new(world.emissive());
    let p = -world.origin().as_vec3();
    for n in [Vec3::Z, Vec3::new(0.6, 0.64, 0.48)] {
        let draw = |s: &mut Stream| sampler.draw(p, n, s.next_2d(), s.next_f32()).map(|drawn| drawn.wi);
        // None of them hides another.
        let pdf = |seen_along: Vec3| {
            let (world, sampler) = (&world, &sampler);
            move |wi: Vec3| {
                let Some((hit, surface)) = world.closest_visible(&Ray::new(p, wi)) else { return 0.0 };
                let met = Met { instance: hit.instance, primitive: hit.primitive, wi, distance: hit.t, local: surface.local };
                sampler.pdf(p, seen_along, &met)
            }
        };
        check(&format!("lights seen from {n}"), of_directions(draw, pdf(n)), of_directions(draw, pdf(Vec3::new(0.0, 0.6, 0.8))));
    }
}
