//! The part of Embree 3.13's C interface that the benchmark calls, by hand: `rtcore_*.h` of libembree-dev.

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::ptr;

use radiosa::accel::{Geometry, Shape};
use radiosa::math::Ray;

/// `RTCRayHit`; the hit is written by closest-hit queries only.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub struct RayHit {
    org: [f32; 3],
    tnear: f32,
    dir: [f32; 3],
    time: f32,
    pub tfar: f32,
    mask: c_uint,
    id: c_uint,
    flags: c_uint,
    ng: [f32; 3],
    uv: [f32; 2],
    pub primitive: c_uint,
    pub geometry: c_uint,
    instance: c_uint,
}

/// `RTCRayHit8`.
#[repr(C, align(32))]
#[derive(Clone, Copy)]
pub struct RayHit8 {
    org: [[f32; 8]; 3],
    tnear: [f32; 8],
    dir: [[f32; 8]; 3],
    time: [f32; 8],
    pub tfar: [f32; 8],
    mask: [c_uint; 8],
    id: [c_uint; 8],
    flags: [c_uint; 8],
    ng: [[f32; 8]; 3],
    uv: [[f32; 8]; 2],
    pub primitive: [c_uint; 8],
    pub geometry: [c_uint; 8],
    instance: [c_uint; 8],
}

/// `RTCIntersectContext`.
#[repr(C)]
pub struct Context {
    flags: c_int,
    filter: *const c_void,
    instance: c_uint,
}

type Handle = *mut c_void;

#[link(name = "embree3")]
unsafe extern "C" {
    fn rtcNewDevice(config: *const c_char) -> Handle;
    fn rtcReleaseDevice(device: Handle);
    fn rtcNewScene(device: Handle) -> Handle;
    fn rtcSetSceneFlags(scene: Handle, flags: c_int);
    fn rtcSetSceneBuildQuality(scene: Handle, quality: c_int);
    fn rtcCommitScene(scene: Handle);
    fn rtcReleaseScene(scene: Handle);
    fn rtcNewGeometry(device: Handle, kind: c_int) -> Handle;
    fn rtcSetNewGeometryBuffer(
        geometry: Handle,
        kind: c_int,
        slot: c_uint,
        format: c_int,
        stride: usize,
        n: usize,
    ) -> *mut c_void;
    fn rtcCommitGeometry(geometry: Handle);
    fn rtcAttachGeometry(scene: Handle, geometry: Handle) -> c_uint;
    fn rtcReleaseGeometry(geometry: Handle);
    fn rtcIntersect1(scene: Handle, context: *mut Context, ray: *mut RayHit);
    fn rtcOccluded1(scene: Handle, context: *mut Context, ray: *mut RayHit);
    fn rtcIntersect8(valid: *const c_int, scene: Handle, context: *mut Context, rays: *mut RayHit8);
    fn rtcOccluded8(valid: *const c_int, scene: Handle, context: *mut Context, rays: *mut RayHit8);
}

const TRIANGLES: c_int = 0;
const INDEX: c_int = 0;
const VERTEX: c_int = 1;
const UINT3: c_int = 0x5003;
const FLOAT3: c_int = 0x9003;
const ROBUST: c_int = 1 << 2;
const COHERENT: c_int = 1;

/// What a scene is built for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Embree's default: Möller–Trumbore, not watertight.
    Fast,
    /// `RTC_SCENE_FLAG_ROBUST`: what comes nearest to Radiosa's promise.
    Robust,
}

/// A committed scene of triangles.
pub struct Embree {
    device: Handle,
    scene: Handle,
}

// SAFETY: a committed scene is only read by queries, which Embree allows from any number of threads.
unsafe impl Sync for Embree {}

impl Embree {
    /// Builds over all meshes; those under a transform are flattened by the caller. Geometry ids are indices into `placed`.
    pub fn build(geometry: &Geometry, mode: Mode) -> Self {
        // SAFETY: handles come from Embree and are used as its manual says; buffers have the size asked for, plus Embree's own padding.
        unsafe {
            let device = rtcNewDevice(ptr::null());
            assert!(!device.is_null(), "Embree gives no device");
            let scene = rtcNewScene(device);
            rtcSetSceneFlags(scene, if mode == Mode::Robust { ROBUST } else { 0 });
            // MEDIUM, the default.
            rtcSetSceneBuildQuality(scene, 1);
            for placed in &geometry.placed {
                let mesh = rtcNewGeometry(device, TRIANGLES);
                let Shape::Mesh { positions, triangles } = &geometry.shapes[placed.shape as usize] else {
                    panic!("the benchmark's scenes are triangles");
                };
                let vertices = rtcSetNewGeometryBuffer(mesh, VERTEX, 0, FLOAT3, 12, positions.len());
                ptr::copy_nonoverlapping(positions.as_ptr().cast::<u8>(), vertices.cast(), 12 * positions.len());
                let indices = rtcSetNewGeometryBuffer(mesh, INDEX, 0, UINT3, 12, triangles.len());
                ptr::copy_nonoverlapping(triangles.as_ptr().cast::<u8>(), indices.cast(), 12 * triangles.len());
                rtcCommitGeometry(mesh);
                rtcAttachGeometry(scene, mesh);
                rtcReleaseGeometry(mesh);
            }
            rtcCommitScene(scene);
            Self { device, scene }
        }
    }

    /// The nearest hit: `tfar` and ids are written.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> RayHit {
        let mut r = RayHit::new(ray);
        // SAFETY: the scene is committed, the structures have Embree's layout.
        unsafe { rtcIntersect1(self.scene, &mut Context::new(0), &mut r) };
        r
    }

    /// Whether anything is hit.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut r = RayHit::new(ray);
        // SAFETY: as above; `rtcOccluded1` touches only the first part, an `RTCRay`.
        unsafe { rtcOccluded1(self.scene, &mut Context::new(0), &mut r) };
        r.tfar < 0.0
    }

    /// Eight at once.
    #[inline]
    pub fn closest8(&self, rays: &[Ray; 8], is_coherent: bool) -> RayHit8 {
        let mut r = RayHit8::new(rays);
        // SAFETY: as above; `valid` has eight entries of −1.
        unsafe { rtcIntersect8(Valid::ALL.0.as_ptr(), self.scene, &mut Context::new(is_coherent.into()), &mut r) };
        r
    }

    /// Eight at once: bits of those that hit anything.
    #[inline]
    pub fn occluded8(&self, rays: &[Ray; 8], is_coherent: bool) -> u8 {
        let mut r = RayHit8::new(rays);
        // SAFETY: as above.
        unsafe { rtcOccluded8(Valid::ALL.0.as_ptr(), self.scene, &mut Context::new(is_coherent.into()), &mut r) };
        (0..8).fold(0, |bits, i| bits | u8::from(r.tfar[i] < 0.0) << i)
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: both are ours and not used again.
        unsafe {
            rtcReleaseScene(self.scene);
            rtcReleaseDevice(self.device);
        }
    }
}

#[repr(align(32))]
struct Valid([c_int; 8]);

impl Valid {
    const ALL: &'static Self = &Self([-1; 8]);
}

const NONE: c_uint = c_uint::MAX;

impl Context {
    fn new(coherent: c_int) -> Self {
        Self { flags: coherent * COHERENT, filter: ptr::null(), instance: NONE }
    }
}

impl RayHit {
    #[inline]
    fn new(r: &Ray) -> Self {
        let (org, dir) = (r.origin.to_array(), r.dir.to_array());
        let nothing = Self {
            org,
            tnear: 0.0,
            dir,
            time: 0.0,
            tfar: r.t_max,
            mask: NONE,
            id: 0,
            flags: 0,
            ng: [0.0; 3],
            uv: [0.0; 2],
            primitive: NONE,
            geometry: NONE,
            instance: NONE,
        };
        nothing
    }
}

impl RayHit8 {
    #[inline]
    fn new(r: &[Ray; 8]) -> Self {
        let column = |f: fn(&Ray) -> f32| r.each_ref().map(f);
        Self {
            org: [column(|r| r.origin.x), column(|r| r.origin.y), column(|r| r.origin.z)],
            tnear: [0.0; 8],
            dir: [column(|r| r.dir.x), column(|r| r.dir.y), column(|r| r.dir.z)],
            time: [0.0; 8],
            tfar: column(|r| r.t_max),
            mask: [NONE; 8],
            id: [0; 8],
            flags: [0; 8],
            ng: [[0.0; 8]; 3],
            uv: [[0.0; 8]; 2],
            primitive: [NONE; 8],
            geometry: [NONE; 8],
            instance: [NONE; 8],
        }
    }
}
