//! Binary PLY with floating-point colours.

use std::io::{self, Write};

use super::LitMesh;

pub(super) fn write(mesh: &LitMesh, out: &mut impl Write) -> io::Result<()> {
    let n_vertices: usize = mesh.surfaces.iter().map(|s| s.vertices.len()).sum();
    let n_triangles: usize = mesh.surfaces.iter().map(|s| s.triangles.len()).sum();
    let mut head = format!("ply\nformat binary_little_endian 1.0\ncomment Radiosa {}\n", env!("CARGO_PKG_VERSION"));
    head += &format!("comment colours are radiances times {}\nelement vertex {n_vertices}\n", mesh.exposure);
    for name in ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"] {
        head += &format!("property float {name}\n");
    }
    for name in ["irradiance", "radiosity"] {
        for channel in ["r", "g", "b"] {
            head += &format!("property float {name}_{channel}\n");
        }
    }
    head += &format!("element face {n_triangles}\nproperty list uchar int vertex_indices\nend_header\n");
    out.write_all(head.as_bytes())?;
    let to_file = mesh.world.scene().from_file.inverse();
    let turn = to_file.matrix3.inverse().transpose();
    for surface in &mesh.surfaces {
        for v in &surface.vertices {
            let (position, normal) = (to_file.transform_point3(v.position), (turn * v.normal.as_dvec3()).normalize_or_zero());
            let columns = [
                position.as_vec3().to_array(),
                normal.as_vec3().to_array(),
                mesh.color(v).to_array(),
                v.irradiance.to_array(),
                v.radiosity.to_array(),
            ];
            out.write_all(bytemuck::cast_slice(&columns))?;
        }
    }
    let mut first = 0;
    for surface in &mesh.surfaces {
        for triangle in &surface.triangles {
            out.write_all(&[3])?;
            out.write_all(bytemuck::cast_slice(&triangle.map(|i| i + first)))?;
        }
        first += surface.vertices.len() as u32;
    }
    Ok(())
}
