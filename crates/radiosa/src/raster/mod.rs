//! Scan conversion: which samples of a grid does a triangle cover, and which triangle is nearest there.
//!
//! ```text
//! projection  from world to homogeneous picture coordinates
//! clip        polygons against the near plane and a guard band, in homogeneous coordinates
//! scan        a triangle on a grid of 1/256 pixel: three edge functions in whole numbers, eight samples at a time
//! depth       a z-buffer that remembers the item seen: pictures, hemicube faces
//! bins        many triangles sorted into tiles, so that tiles can be drawn in parallel
//! ```
//!
//! Three users want three things of it: pictures want the nearest face at every sample, a hemicube wants the same of its five faces (an *item
//! buffer*), a lightmap wants the texels a triangle covers in texture space, without depth ([`Triangle::samples`]).
//!
//! # What is promised
//!
//! - **Fill rule.** Vertices are rounded to a grid of 1/256 pixel once; from then on everything is decided in whole numbers. A sample on an edge
//!   belongs to the triangle whose edge is a top or a left one there, so triangles that share an edge or a vertex cover every sample once:
//!   no cracks, nothing drawn twice [Pineda88].
//! - Clipping cuts a shared edge in both triangles at the same point, bit for bit.
//! - Of faces at the same depth the one that came first wins.
//! - The same bits on both processor paths but for the last bit of depths.
//!
//! Coordinates: x to the right, y down, in pixels from the *middle* of the picture, which keeps them short: half a picture is at most 2¹⁵
//! pixels, 2²³ steps of the grid, so that products of two differences stay below 2⁵³.

pub mod bins;
pub mod clip;
pub mod depth;
pub mod projection;
pub mod scan;

pub use bins::{Bins, Grid};
pub use clip::clip;
pub use depth::ItemBuffer;
pub use projection::{Homogeneous, Projection};
pub use scan::{Sample, Tile, Triangle};

/// Steps of the grid a pixel.
pub const SUBPIXELS: i32 = 256;
/// How far from the middle of the picture a vertex may lie after clipping, pixels.
pub const GUARD: f64 = 32_768.0;
/// Pixels a side of a tile. Depth and item of 32 × 32 samples are 8 kB: they stay in the nearest cache while a tile is drawn.
pub const TILE: u32 = 32;
