//! The three scenes on which links of hierarchical radiosity are counted.

use std::fmt::Write;
use std::path::Path;

use radiosa::import;
use radiosa::scene::Scene;

/// A room with a lamp.
const EMPTY: &str = r#"
[material.walls]
lambert = 0.7
[material.lamp]
lambert = 0.3
emission = 10
[[shape]]
name = "room"
material = "walls"
box = { min = [0, 0, 0], max = [4, 3, 5], inward = true }
[[shape]]
name = "lamp"
material = "lamp"
quad = [[1.5, 2.9, 2], [2.5, 2.9, 2], [2.5, 2.9, 3], [1.5, 2.9, 3]]
"#;

/// The room with more in it.
fn room(more: &str) -> Result<Scene, import::ImportError> {
    Ok(import::load_bytes(format!("{EMPTY}{more}").as_bytes(), Path::new("room.toml"), &import::Options::default())?.0)
}

/// Boxes of all heights, in rows.
fn boxes() -> String {
    let mut text = String::new();
    for k in 0..20u32 {
        let [x, z] = [0.3 + 0.75 * f64::from(k % 5), 0.4 + 1.2 * f64::from(k / 5)];
        let height = 0.3 + 2.1 * f64::from(k * 7 % 20) / 20.0;
        // (A string takes everything.)
        let _ = writeln!(
            text,
            "[[shape]]\nmaterial = \"walls\"\nbox = {{ min = [{x}, 0, {z}], max = [{}, {height}, {}] }}",
            x + 0.4,
            z + 0.5
        );
    }
    text
}

/// What a scene is called, the colour of its curve, and itself.
type Named = (&'static str, &'static str, Scene);

/// All three.
pub(crate) fn scenes() -> Result<[Named; 3], Box<dyn std::error::Error>> {
    let cornell = import::sample::load("cornell-box").ok_or("it is built in")?;
    Ok([
        ("Cornell box", "#0072b2", cornell),
        ("room full of boxes", "#d55e00", room(&boxes())?),
        ("empty room", "#009e73", room("")?),
    ])
}
