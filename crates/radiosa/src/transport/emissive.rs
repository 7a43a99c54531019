//! The surfaces that emit, as the methods that sample them want them.

use super::{Surface, World};
use crate::accel::Shape;
use crate::emitter::area::{EmissiveShape, EmissiveSurface};
use crate::math::{DVec3, Vec3};
use crate::scene::{AlphaMode, InstanceId};
use crate::spectrum::Spectrum;

impl World {
    /// Every placed triangle or exact shape whose material emits, with its mean radiance, in the order of the scene.
    pub(super) fn collect_emissive(&self) -> Vec<EmissiveSurface> {
        let mut found = Vec::new();
        let geometry = self.accel().geometry();
        for (i, placed) in geometry.placed.iter().enumerate() {
            let instance = InstanceId(i as u32);
            let emits = |primitive: u32| {
                let id = self.scene().material_of(instance, primitive);
                self.material(id).is_emissive().then_some(id)
            };
            match &geometry.shapes[placed.shape as usize] {
                Shape::Mesh { positions, triangles } => {
                    for (primitive, tri) in triangles.iter().enumerate() {
                        let primitive = primitive as u32;
                        let Some(material) = emits(primitive) else { continue };
                        let p = tri.map(|v| {
                            let p = positions[v as usize];
                            placed.to_world.map_or(p, |m| m.transform_point3(p))
                        });
                        // Winding that turns the front outwards, whatever the transform did.
                        let p = if self.is_mirrored(instance) { [p[0], p[2], p[1]] } else { p };
                        let radiance = self.mean_emission(instance, primitive, material);
                        if radiance.is_black() || (p[1] - p[0]).cross(p[2] - p[0]) == Vec3::ZERO {
                            continue;
                        }
                        let two_sided = self.material(material).two_sided;
                        found.push(EmissiveSurface {
                            shape: EmissiveShape::Triangle(p),
                            radiance,
                            two_sided,
                            instance,
                            primitive,
                        });
                    }
                }
                shape => {
                    let Some(material) = emits(0) else { continue };
                    let Some(m) = placed.to_world else { continue };
                    let shape = if matches!(shape, Shape::Sphere) { EmissiveShape::Sphere(m) } else { EmissiveShape::Disc(m) };
                    let radiance = self.mean_emission(instance, 0, material);
                    if !radiance.is_black() && m.matrix3.determinant() != 0.0 {
                        let two_sided = self.material(material).two_sided;
                        found.push(EmissiveSurface { shape, radiance, two_sided, instance, primitive: 0 });
                    }
                }
            }
        }
        found
    }

    /// The radiance that leaves a point (world coordinates) of an emissive surface on the side that emits, by its texture and as far as it is there.
    pub(crate) fn emission_from(&self, emissive: &EmissiveSurface, position: Vec3) -> Spectrum {
        let material = self.scene().material_of(emissive.instance, emissive.primitive);
        let (emission, alpha) = (&self.material(material).emission, &self.material(material).alpha);
        if emission.texture.is_none() && alpha.mode == AlphaMode::Opaque {
            return emission.factor;
        }
        let (mut weights, mut local) = ([0.0; 3], Vec3::ZERO);
        match &emissive.shape {
            EmissiveShape::Triangle([a, b, c]) => {
                // Each weight is the part of the area that lies opposite.
                let normal = (b - a).as_dvec3().cross((c - a).as_dvec3());
                let part = |from: &Vec3, to: &Vec3| {
                    let [from, to] = [from, to].map(|v| (v - position).as_dvec3());
                    (from.cross(to).dot(normal) / normal.length_squared()).clamp(0.0, 1.0) as f32
                };
                let (v, w) = (part(c, a), part(a, b));
                weights = [(1.0 - v - w).max(0.0), v, w];
                if self.is_mirrored(emissive.instance) {
                    weights.swap(1, 2);
                }
            }
            EmissiveShape::Sphere(m) => local = m.inverse().transform_point3(position).normalize_or(Vec3::Y),
            EmissiveShape::Disc(m) => local = m.inverse().transform_point3(position) * Vec3::new(1.0, 0.0, 1.0),
        }
        let surface = Surface {
            weights,
            local,
            instance: emissive.instance,
            primitive: emissive.primitive,
            material,
            ..Surface::in_space(position, Vec3::ZERO, Vec3::Y)
        };
        self.emission_at(&surface) * self.opacity(&surface)
    }

    /// The mean of the emission that is there (emission times coverage) over a primitive: exact without textures and alpha, over a fixed pattern with
    /// them.
    fn mean_emission(&self, instance: InstanceId, primitive: u32, material: Option<crate::scene::MaterialId>) -> Spectrum {
        let (emission, alpha) = (&self.material(material).emission, &self.material(material).alpha);
        if emission.texture.is_none() && alpha.mode == AlphaMode::Opaque {
            return emission.factor;
        }
        const SIDE: u32 = 8;
        let mut sum = DVec3::ZERO;
        let mut n = 0.0;
        for i in 0..SIDE {
            for j in 0..SIDE {
                let (a, b) = ((i as f32 + 0.5) / SIDE as f32, (j as f32 + 0.5) / SIDE as f32);
                // Folding the square's upper half back keeps the pattern uniform over the triangle.
                let (u, v) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
                let surface = Surface {
                    p: Vec3::ZERO,
                    p_error: Vec3::ZERO,
                    ng: Vec3::Y,
                    n: Vec3::Y,
                    instance,
                    primitive,
                    weights: [1.0 - u - v, u, v],
                    local: crate::sampling::warp::uniform_sphere(crate::math::Vec2::new(a, b)),
                    material,
                    width: 0.0,
                };
                let l = self.emission_at(&surface) * self.opacity(&surface);
                sum += DVec3::new(f64::from(l.r), f64::from(l.g), f64::from(l.b));
                n += 1.0;
            }
        }
        let mean = (sum / n).as_vec3();
        Spectrum::new(mean.x, mean.y, mean.z)
    }
}
