//! Laws that reflection has to keep, checked on every model, and the historical models that are known to break them: an
//! exception that stopped being one would fail here too.

use radiosa::bsdf::{Bsdf, FactorsOnly, Transmission, cook_torrance, metallic_roughness, phong};
use radiosa::math::{DQuat, DVec3, Vec2, Vec3, function};
use radiosa::sampling::{Stream, sequence, warp};
use radiosa::scene::{self, Distribution, Form, Fresnel, Metal, PhongLobe, Shadowing};
use radiosa::spectrum::Spectrum;

/// A model with the laws it breaks.
struct Member {
    name: String,
    bsdf: Bsdf,
    reciprocal: bool,
    /// Reflects no more than it receives.
    conserving: bool,
}

/// Every model, in its variants.
fn members() -> Vec<Member> {
    let mut members = vec![Member {
        name: "Lambert".into(),
        bsdf: Bsdf::lambert(Spectrum::new(1.0, 0.5, 0.2)),
        reciprocal: true,
        conserving: true,
    }];
    for lobe in [PhongLobe::Phong, PhongLobe::BlinnPhong] {
        members.push(Member {
            name: format!("{lobe:?} 2"),
            bsdf: Bsdf::Phong(phong::Phong { specular: Spectrum::WHITE, exponent: 2.0, lobe, ..phong::Phong::default() }),
            reciprocal: false,
            conserving: false,
        });
    }
    let (n, k) = Metal::Copper.indices();
    for distribution in [Distribution::Beckmann, Distribution::Ggx] {
        for shadowing in [Shadowing::VCavity, Shadowing::Smith, Shadowing::SmithCorrelated] {
            for fresnel in [Fresnel::One, Fresnel::Dielectric { ior: 1.5 }, Fresnel::Conductor { n, k }] {
                for alpha in [0.1, 0.5, 1.0] {
                    for form in [Form::Modern, Form::Paper1982, Form::Lecture] {
                        let rough_metal = fresnel == Fresnel::One && alpha < 1.0;
                        if form != Form::Modern && !rough_metal {
                            continue;
                        }
                        let specular = cook_torrance::CookTorrance {
                            ambient: Spectrum::BLACK,
                            diffuse: Spectrum::BLACK,
                            specular: Spectrum::WHITE,
                            alpha,
                            distribution,
                            shadowing,
                            fresnel,
                            form,
                            transmission: None,
                            compensation: None,
                        };
                        members.push(Member {
                            name: format!("{distribution:?} {shadowing:?} {alpha} {fresnel:?} {form:?}"),
                            bsdf: Bsdf::CookTorrance(specular),
                            reciprocal: form != Form::Lecture,
                            conserving: form == Form::Modern,
                        });
                    }
                }
            }
        }
    }
    for alpha in [0.2, 0.9] {
        let material = scene::Material {
            model: scene::Model::CookTorrance(scene::CookTorrance {
                diffuse: scene::ColorMap::constant(Spectrum::BLACK),
                alpha: scene::ScalarMap::constant(alpha),
                fresnel: Fresnel::One,
                ..scene::CookTorrance::default()
            }),
            ..scene::Material::default()
        };
        let bsdf = Bsdf::resolve(&material, &FactorsOnly).compensated();
        members.push(Member { name: format!("compensated {alpha}"), bsdf, reciprocal: true, conserving: true });
    }
    for (metallic, roughness, conserving) in [(1.0, 0.3, true), (1.0, 1.0, true), (0.5, 0.3, false), (0.0, 0.3, false)] {
        let material = scene::Material {
            model: scene::Model::MetallicRoughness(scene::MetallicRoughness {
                metallic: scene::ScalarMap::constant(metallic),
                roughness: scene::ScalarMap::constant(roughness),
                ..scene::MetallicRoughness::default()
            }),
            ..scene::Material::default()
        };
        members.push(Member {
            name: format!("metallic {metallic} roughness {roughness}"),
            bsdf: Bsdf::resolve(&material, &FactorsOnly),
            reciprocal: true,
            conserving,
        });
    }
    members
}

/// Random directions above the horizon.
fn directions(n: u64) -> Vec<Vec3> {
    (0..n).map(|i| warp::uniform_hemisphere(Stream::new(3, i, 0).next_2d())).filter(|w| w.z > 0.02).collect()
}

/// The largest relative difference between `f(a, b)` and `f(b, a)`.
fn asymmetry(f: impl Fn(Vec3, Vec3) -> Spectrum) -> f32 {
    let w = directions(400);
    w.chunks_exact(2)
        .map(|pair| (f(pair[0], pair[1]), f(pair[1], pair[0])))
        .filter(|(a, b)| a.max_channel().max(b.max_channel()) > 1e-20)
        .map(|(a, b)| (a - b).map(f32::abs).max_channel() / a.max_channel().max(b.max_channel()))
        .fold(0.0, f32::max)
}

#[test]
fn reflection_is_reciprocal_except_where_history_says_otherwise() {
    for Member { name, bsdf, reciprocal, .. } in members() {
        let worst = asymmetry(|wo, wi| bsdf.evaluate(Vec3::Z, wo, wi).sum());
        assert_eq!(worst < 1e-4, reciprocal, "{name}: f(a, b) and f(b, a) differ by {worst}");
    }
    let lafortune = asymmetry(|wo, wi| phong::lafortune(Spectrum::WHITE, Vec3::Z, wo, wi, 20.0));
    assert!(lafortune < 1e-4, "{lafortune}");
}

/// `∫ f (n·wo) dωo`, the part reflected of what is received from `wi`: half of the points after the cosine, half around the mirror
/// direction, weighed by the balance heuristic.
fn albedo(f: impl Fn(Vec3, Vec3) -> Spectrum, wi: Vec3) -> f32 {
    const N: u32 = 1 << 12;
    const POWER: f32 = 40.0;
    let mirror = Vec3::new(-wi.x, -wi.y, wi.z);
    let frame = radiosa::math::Frame::from_normal(mirror);
    let lobe_pdf = |w: Vec3| (POWER + 1.0) / std::f32::consts::TAU * function::pow(w.dot(mirror).max(0.0), POWER);
    let mut sum = 0.0f64;
    for i in 0..N {
        for (around_mirror, key) in [(false, 1), (true, 2)] {
            let u = sequence::point_2d(i, key);
            let wo = if around_mirror {
                let cos = function::pow(1.0 - u.x, 1.0 / (POWER + 1.0));
                let sin = (1.0 - cos * cos).max(0.0).sqrt();
                let phi = std::f32::consts::TAU * u.y;
                frame.to_world(Vec3::new(sin * function::cos(phi), sin * function::sin(phi), cos))
            } else {
                warp::cosine_hemisphere(Vec2::new(u.x, u.y))
            };
            if wo.z > 0.0 {
                let pdf = warp::cosine_hemisphere_pdf(wo) + lobe_pdf(wo);
                sum += f64::from(f(wo, wi).max_channel() * wo.z / pdf);
            }
        }
    }
    (sum / f64::from(N)) as f32
}

#[test]
fn nothing_reflects_more_than_it_receives_except_where_history_says_otherwise() {
    for Member { name, bsdf, conserving, .. } in members() {
        let worst = [0.0f32, 30.0, 60.0, 75.0, 85.0]
            .map(|degrees| {
                let theta = degrees.to_radians();
                albedo(|wo, wi| bsdf.evaluate(Vec3::Z, wo, wi).sum(), Vec3::new(function::sin(theta), 0.0, function::cos(theta)))
            })
            .into_iter()
            .fold(0.0, f32::max);
        // The quadrature is good to a hundredth; the exceptions are far beyond.
        assert_eq!(worst < 1.01, conserving, "{name}: albedo {worst}");
    }
    let at_normal = albedo(|wo, wi| phong::lafortune(Spectrum::WHITE, Vec3::Z, wo, wi, 20.0), Vec3::Z);
    assert!((at_normal - 1.0).abs() < 0.01, "{at_normal}");
}

#[test]
fn turning_the_surface_with_its_surroundings_changes_nothing() {
    let w = directions(60);
    for (i, Member { name, bsdf, .. }) in members().into_iter().enumerate() {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), i as f64 * 0.37 + 0.1);
        let turned = |v: Vec3| (turn * v.as_dvec3()).as_vec3();
        for pair in w.chunks_exact(2) {
            let a = bsdf.evaluate_cos(Vec3::Z, pair[0], pair[1]).sum().max_channel();
            let b = bsdf.evaluate_cos(turned(Vec3::Z), turned(pair[0]), turned(pair[1])).sum().max_channel();
            // Rotating rounds the directions; far from a sharp lobe's peak that is amplified.
            assert!((a - b).abs() <= 1e-3 * a.abs() + 1e-12, "{name}: {a} became {b}");
        }
    }
}

#[test]
fn light_from_behind_is_not_reflected() {
    for Member { name, bsdf, .. } in members() {
        for wi in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, 0.0, -0.8)] {
            assert_eq!(bsdf.evaluate(Vec3::Z, Vec3::new(0.0, 0.6, 0.8), wi).sum(), Spectrum::BLACK, "{name}");
        }
    }
}

#[test]
fn values_stay_finite_at_the_horizon() {
    let grazing = |x: f32| Vec3::new((1.0 - x * x).sqrt(), 0.0, x);
    for Member { name, bsdf, .. } in members() {
        for (a, b) in [(1e-3, 1e-7), (1e-7, 1e-3), (1e-7, 1e-7), (1e-20, 0.5), (0.5, 1e-20), (1.0, 1e-30)] {
            for wi in [grazing(b), grazing(b) * Vec3::new(-1.0, 1.0, 1.0)] {
                let f = bsdf.evaluate_cos(Vec3::Z, grazing(a), wi).sum();
                assert!(f.is_finite() && f.r >= 0.0, "{name} at {a} {b}: {f:?}");
            }
        }
    }
}

/// A pane or body of clear glass.
fn glass(thin: bool) -> Bsdf {
    Bsdf::Phong(phong::Phong {
        mirror: Spectrum::WHITE,
        transmission: Some(Transmission { weight: Spectrum::WHITE, ior: 1.5, thin, absorption: Spectrum::BLACK, priority: 0 }),
        fresnel: Some(1.5),
        ..phong::Phong::default()
    })
}

#[test]
fn clear_glass_parts_light_without_losing_any() {
    for thin in [false, true] {
        for entering in [false, true] {
            for wo in directions(200) {
                let rays = glass(thin).specular_rays(Vec3::Z, wo, entering);
                let part = |ray: Option<(Vec3, Spectrum)>| ray.map_or(0.0, |r| r.1.g);
                let total = part(rays.reflected) + part(rays.refracted);
                assert!((total - 1.0).abs() < 1e-6, "{total} at {wo}");
                let Some((t, _)) = rays.refracted else {
                    // Only from inside and beyond the critical angle, sin θ > 2/3.
                    assert!(!thin && !entering && wo.truncate().length() > 0.666);
                    continue;
                };
                if thin {
                    assert_eq!(t, -wo);
                    continue;
                }
                let ratio = if entering { 1.5 } else { 1.0 / 1.5 };
                assert!((wo.truncate().length() - ratio * t.truncate().length()).abs() < 1e-5, "Snell's law");
                // Light the other way takes the same path, and the same part of it.
                let back = glass(false).specular_rays(Vec3::NEG_Z, t, !entering);
                let (w, f) = back.refracted.expect("what went in can come out");
                assert!((w - wo).length() < 1e-4 && (f.g - part(rays.refracted)).abs() < 1e-4);
            }
        }
    }
}

#[test]
fn what_cannot_be_refracted_is_reflected_by_constants_too() {
    let Bsdf::Phong(mut m) = glass(false) else { unreachable!("glass is a Phong material") };
    (m.fresnel, m.mirror) = (None, Spectrum::gray(0.25));
    m.transmission = m.transmission.map(|t| Transmission { weight: Spectrum::gray(0.75), ..t });
    let grazing = Vec3::new(0.8, 0.0, 0.6);
    let inside = Bsdf::Phong(m).specular_rays(Vec3::Z, grazing, false);
    assert_eq!((inside.refracted, inside.reflected.map(|r| r.1)), (None, Some(Spectrum::WHITE)));
    let outside = Bsdf::Phong(m).specular_rays(Vec3::Z, grazing, true);
    assert_eq!(outside.reflected.map(|r| r.1), Some(Spectrum::gray(0.25)));
    assert_eq!(outside.refracted.map(|r| r.1), Some(Spectrum::gray(0.75)));
}

#[test]
fn a_smooth_metal_is_a_mirror_of_its_colour() {
    let gold = Spectrum::new(1.0, 0.8, 0.3);
    let metal = metallic_roughness::MetallicRoughness {
        base_color: gold,
        metallic: 1.0,
        alpha: 0.0,
        ior: 1.5,
        specular: 1.0,
        f0: Spectrum::gray(0.04),
        transmission: 0.0,
        occlusion: 1.0,
        absorption: Spectrum::BLACK,
        thick: false,
        inside: false,
        compensation: None,
    };
    let bsdf = Bsdf::MetallicRoughness(metal);
    assert!(bsdf.is_specular_only());
    assert_eq!(bsdf.specular_rays(Vec3::Z, Vec3::Z, true).reflected, Some((Vec3::Z, gold)));
    assert_eq!(bsdf.evaluate(Vec3::Z, Vec3::Z, Vec3::Z).sum(), Spectrum::BLACK);
}
