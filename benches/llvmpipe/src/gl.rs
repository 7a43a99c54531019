//! OpenGL without a window: a context of Mesa's surfaceless platform, a framebuffer of 16-bit floats, and a frame.

use std::collections::HashMap;
use std::error::Error;

use glow::HasContext;
use khronos_egl as egl;
use radiosa::film::{Film, Layer, Pixel};
use radiosa::math::Vec3;
use radiosa::scanline::Interpolation;
use radiosa::scene::{Filter, MaterialId, Pixels, Projection, TextureId, TextureSource, Wrap};
use radiosa::spectrum::Spectrum;

use crate::mesh::{self, Batch, Buffers};
use crate::shader::{self, Kind, Uniform};
use crate::stage::Stage;

/// `EGL_PLATFORM_SURFACELESS_MESA`.
const SURFACELESS: egl::Enum = 0x31DD;

/// `GL_LOWER_LEFT` and `GL_ZERO_TO_ONE`, for `glClipControl`.
const LOWER_LEFT: u32 = 0x8CA1;
const ZERO_TO_ONE: u32 = 0x935F;

/// A context and its framebuffer.
pub struct Gl {
    gl: glow::Context,
    size: (u32, u32),
    about: String,
}

/// A program and where its uniforms are.
struct Program {
    program: glow::Program,
    places: HashMap<&'static str, Option<glow::UniformLocation>>,
}

/// What is drawn with one program and one set of constants.
struct Surface {
    kind: Kind,
    uniforms: Vec<Uniform>,
    texture: Option<glow::Texture>,
    emits_behind: bool,
}

/// A scene on the other side.
pub struct Upload {
    array: glow::VertexArray,
    batches: Vec<Batch>,
    programs: HashMap<Kind, Program>,
    depth: Program,
    surfaces: HashMap<Option<MaterialId>, Surface>,
    near: f32,
}

/// Whether depth is drawn alone first, so that only what is seen is lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passes {
    One,
    DepthFirst,
}

impl Gl {
    /// A context for pictures of one size.
    pub fn new(size: (u32, u32)) -> Result<Self, Box<dyn Error>> {
        // SAFETY: libEGL is the system's; its functions are called as the crate declares them.
        let egl = unsafe { egl::DynamicInstance::<egl::EGL1_5>::load_required() }
            .map_err(|e| format!("no EGL ({e}); on Debian: apt-get install libegl1 libgl1-mesa-dri"))?;
        // SAFETY: the platform takes no native display.
        let display = unsafe { egl.get_platform_display(SURFACELESS, egl::DEFAULT_DISPLAY, &[egl::ATTRIB_NONE]) }?;
        egl.initialize(display)?;
        egl.bind_api(egl::OPENGL_API)?;
        let wanted = [egl::SURFACE_TYPE, egl::PBUFFER_BIT, egl::RENDERABLE_TYPE, egl::OPENGL_BIT, egl::NONE];
        let config = egl.choose_first_config(display, &wanted)?.ok_or("no configuration of EGL draws OpenGL")?;
        let version = [
            egl::CONTEXT_MAJOR_VERSION,
            4,
            egl::CONTEXT_MINOR_VERSION,
            5,
            egl::CONTEXT_OPENGL_PROFILE_MASK,
            egl::CONTEXT_OPENGL_CORE_PROFILE_BIT,
            egl::NONE,
        ];
        let context = egl.create_context(display, config, None, &version)?;
        egl.make_current(display, None, None, Some(context))?;
        let address = |name: &str| egl.get_proc_address(name).map_or(std::ptr::null(), |f| f as *const _);
        // SAFETY: the context is current on this thread, the only one that uses it, until the end of the program.
        let gl = unsafe { glow::Context::from_loader_function(address) };
        let clip_control = egl.get_proc_address("glClipControl").ok_or("this OpenGL has no glClipControl")?;
        // SAFETY: that is the function's type in OpenGL 4.5; the crate for the rest does not know it.
        let clip_control = unsafe { std::mem::transmute::<extern "system" fn(), extern "system" fn(u32, u32)>(clip_control) };
        // The library must stay where it is.
        std::mem::forget(egl);
        // SAFETY: as above; names of objects come from the same context.
        unsafe {
            let about = format!("{}; OpenGL {}", gl.get_parameter_string(glow::RENDERER), gl.get_parameter_string(glow::VERSION));
            let framebuffer = gl.create_framebuffer()?;
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(framebuffer));
            for (format, place) in [(glow::RGBA16F, glow::COLOR_ATTACHMENT0), (glow::DEPTH_COMPONENT32F, glow::DEPTH_ATTACHMENT)]
            {
                let buffer = gl.create_renderbuffer()?;
                gl.bind_renderbuffer(glow::RENDERBUFFER, Some(buffer));
                gl.renderbuffer_storage(glow::RENDERBUFFER, format, size.0 as i32, size.1 as i32);
                gl.framebuffer_renderbuffer(glow::FRAMEBUFFER, place, glow::RENDERBUFFER, Some(buffer));
            }
            if gl.check_framebuffer_status(glow::FRAMEBUFFER) != glow::FRAMEBUFFER_COMPLETE {
                return Err("the framebuffer cannot be had".into());
            }
            gl.viewport(0, 0, size.0 as i32, size.1 as i32);
            // Depth runs from one at the near plane to zero far away, where floats are fine.
            clip_control(LOWER_LEFT, ZERO_TO_ONE);
            gl.enable(glow::DEPTH_TEST);
            gl.clear_depth_f32(0.0);
            Ok(Self { gl, size, about })
        }
    }

    /// Renderer and version, as it names them.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// Buffers, textures and programs of a scene.
    pub fn upload(&self, stage: &Stage, interpolation: Interpolation) -> Result<Upload, Box<dyn Error>> {
        let gl = &self.gl;
        let buffers = Buffers::new(&stage.world, interpolation)?;
        let (constants, lights) = shader::of_lights(&stage.lights)?;
        let mut programs = HashMap::new();
        let mut surfaces = HashMap::new();
        let mut textures = HashMap::new();
        for batch in &buffers.batches {
            if surfaces.contains_key(&batch.material) {
                continue;
            }
            let material = stage.world.material(batch.material);
            let (kind, uniforms) = shader::of_material(material)?;
            if let std::collections::hash_map::Entry::Vacant(free) = programs.entry(kind) {
                let program = Program::new(gl, &shader::sources(kind, interpolation, &constants))?;
                // SAFETY: the program is of this context.
                unsafe { gl.use_program(Some(program.program)) };
                lights.iter().for_each(|uniform| program.set(gl, uniform));
                program.set(gl, &shader::of_eye(stage.view.eye()));
                free.insert(program);
            }
            let texture = match mesh::texture_of(&stage.world, batch.material) {
                None => None,
                Some(map) => Some(match textures.get(&map.texture) {
                    Some(texture) => *texture,
                    None => *textures.entry(map.texture).or_insert(self.texture(stage, map.texture)?),
                }),
            };
            surfaces.insert(batch.material, Surface { kind, uniforms, texture, emits_behind: material.two_sided });
        }
        let depth = Program::new(gl, &shader::depth_sources())?;
        // SAFETY: the slices are plain numbers; offsets lie within a vertex.
        let array = unsafe {
            let array = gl.create_vertex_array()?;
            gl.bind_vertex_array(Some(array));
            gl.bind_buffer(glow::ARRAY_BUFFER, Some(gl.create_buffer()?));
            gl.buffer_data_u8_slice(glow::ARRAY_BUFFER, bytes(&buffers.vertices), glow::STATIC_DRAW);
            gl.bind_buffer(glow::ELEMENT_ARRAY_BUFFER, Some(gl.create_buffer()?));
            gl.buffer_data_u8_slice(glow::ELEMENT_ARRAY_BUFFER, bytes(&buffers.indices), glow::STATIC_DRAW);
            let stride = mesh::stride(interpolation) as i32;
            for (place, n, first) in [(0, 3, 0), (1, 3, 3), (2, 2, 6), (3, 3, 8)].into_iter().filter(|p| p.2 < stride) {
                gl.vertex_attrib_pointer_f32(place, n, glow::FLOAT, false, 4 * stride, 4 * first);
                gl.enable_vertex_attrib_array(place);
            }
            array
        };
        let bounds = stage.world.accel().bounds();
        let reach = bounds.min.abs().max(bounds.max.abs()).max(stage.view.eye().abs()).max_element();
        // As near as ours.
        Ok(Upload { array, batches: buffers.batches, programs, depth, surfaces, near: reach * 1e-7 })
    }

    fn texture(&self, stage: &Stage, id: TextureId) -> Result<glow::Texture, Box<dyn Error>> {
        let (gl, scene) = (&self.gl, stage.world.scene());
        let texture = &scene.textures[id.index()];
        let TextureSource::Image(image) = texture.source else { return Err("checkers are not drawn here".into()) };
        let image = &scene.images[image.index()];
        let Pixels::Rgba8(values) = &image.pixels else { return Err("deep textures are not drawn here".into()) };
        let format = if texture.is_srgb { glow::SRGB8_ALPHA8 } else { glow::RGBA8 };
        let wrap = |wrap| match wrap {
            Wrap::Repeat => glow::REPEAT,
            Wrap::Mirror => glow::MIRRORED_REPEAT,
            Wrap::Clamp => glow::CLAMP_TO_EDGE,
        };
        let smaller = if stage.filter == Filter::Mipmap { glow::LINEAR_MIPMAP_LINEAR } else { glow::LINEAR };
        // SAFETY: the slice holds four bytes for each pixel, which the scene's validation saw to.
        unsafe {
            let name = gl.create_texture()?;
            gl.bind_texture(glow::TEXTURE_2D, Some(name));
            let (width, height) = (image.width as i32, image.height as i32);
            let data = glow::PixelUnpackData::Slice(Some(values));
            gl.tex_image_2d(glow::TEXTURE_2D, 0, format as i32, width, height, 0, glow::RGBA, glow::UNSIGNED_BYTE, data);
            gl.generate_mipmap(glow::TEXTURE_2D);
            for (what, value) in [
                (glow::TEXTURE_WRAP_S, wrap(texture.sampler.wrap_u)),
                (glow::TEXTURE_WRAP_T, wrap(texture.sampler.wrap_v)),
                (glow::TEXTURE_MIN_FILTER, smaller),
                (glow::TEXTURE_MAG_FILTER, glow::LINEAR),
            ] {
                gl.tex_parameter_i32(glow::TEXTURE_2D, what, value as i32);
            }
            Ok(name)
        }
    }

    /// The quicker of the two ways, tried a few times each; both have been compiled then.
    pub fn faster(&self, upload: &Upload, stage: &Stage) -> Passes {
        let time = |passes| {
            self.draw(upload, stage, passes);
            let mut times = crate::measure::Times::default();
            for _ in 0..3 {
                times.push(crate::measure::time(|| self.draw(upload, stage, passes)).1);
            }
            times.median().wall
        };
        if time(Passes::DepthFirst) < time(Passes::One) { Passes::DepthFirst } else { Passes::One }
    }

    /// A frame, done when this returns.
    pub fn draw(&self, upload: &Upload, stage: &Stage, passes: Passes) {
        let gl = &self.gl;
        let projection = projection(stage, upload.near);
        let seen: Vec<&Batch> = upload.batches.iter().filter(|b| may_be_seen(b, &projection)).collect();
        let background = stage.background().unwrap_or(Spectrum::BLACK);
        // SAFETY: all names are of this context, and the indices were made for these vertices.
        unsafe {
            gl.bind_vertex_array(Some(upload.array));
            gl.depth_mask(true);
            gl.depth_func(glow::GREATER);
            gl.clear_color(background.r, background.g, background.b, 1.0);
            gl.clear(glow::COLOR_BUFFER_BIT | glow::DEPTH_BUFFER_BIT);
            if passes == Passes::DepthFirst {
                gl.use_program(Some(upload.depth.program));
                upload.depth.set_projection(gl, &projection);
                gl.color_mask(false, false, false, false);
                runs(&seen, |_| ()).for_each(|run| draw_run(gl, run));
                gl.color_mask(true, true, true, true);
                gl.depth_mask(false);
                gl.depth_func(glow::EQUAL);
            }
            for program in upload.programs.values() {
                gl.use_program(Some(program.program));
                program.set_projection(gl, &projection);
            }
            let mut kind = None;
            let mut material = None;
            for run in runs(&seen, |b| b.material) {
                let surface = &upload.surfaces[&run.0];
                let program = &upload.programs[&surface.kind];
                if kind != Some(surface.kind) {
                    gl.use_program(Some(program.program));
                    kind = Some(surface.kind);
                    material = None;
                }
                if material != Some(run.0) {
                    surface.uniforms.iter().for_each(|uniform| program.set(gl, uniform));
                    gl.uniform_1_f32(program.place("emits_behind"), f32::from(u8::from(surface.emits_behind)));
                    gl.bind_texture(glow::TEXTURE_2D, surface.texture);
                    material = Some(run.0);
                }
                draw_run(gl, run);
            }
            gl.finish();
        }
    }

    /// The frame, as a film.
    pub fn read(&self, stage: &Stage) -> Result<Film, Box<dyn Error>> {
        let (width, height) = self.size;
        let mut values = vec![0f32; 4 * (width * height) as usize];
        // SAFETY: there is room for four floats a pixel.
        unsafe {
            let data = glow::PixelPackData::Slice(Some(bytes_mut(&mut values)));
            self.gl.read_pixels(0, 0, width as i32, height as i32, glow::RGBA, glow::FLOAT, data);
            let error = self.gl.get_error();
            if error != glow::NO_ERROR {
                return Err(format!("OpenGL says error {error:#x}").into());
            }
        }
        if stage.background().is_none() {
            println!("note: what stands behind the scene is drawn black by OpenGL");
        }
        let mut film = Film::new(width, height, &[Layer::Color])?;
        for (i, p) in values.chunks_exact(4).enumerate() {
            let (x, y) = (i as u32 % width, height - 1 - i as u32 / width);
            film.set_pixel(x, y, &Pixel { color: Spectrum::new(p[0], p[1], p[2]), ..Pixel::default() });
        }
        Ok(film)
    }
}

impl Program {
    fn new(gl: &glow::Context, sources: &[String; 2]) -> Result<Self, Box<dyn Error>> {
        // SAFETY: all names are of this context.
        let program = unsafe {
            let program = gl.create_program()?;
            for (kind, source) in [glow::VERTEX_SHADER, glow::FRAGMENT_SHADER].into_iter().zip(sources) {
                let shader = gl.create_shader(kind)?;
                gl.shader_source(shader, source);
                gl.compile_shader(shader);
                if !gl.get_shader_compile_status(shader) {
                    return Err(gl.get_shader_info_log(shader).into());
                }
                gl.attach_shader(program, shader);
            }
            gl.link_program(program);
            if !gl.get_program_link_status(program) {
                return Err(gl.get_program_info_log(program).into());
            }
            program
        };
        const NAMES: [&str; 25] = [
            "projection",
            "emits_behind",
            "eye",
            "ambient",
            "base",
            "specular_a",
            "coat",
            "metal",
            "emission",
            "point_at",
            "point_e",
            "point_falloff",
            "point_limits",
            "spot_axis",
            "spot_profile",
            "distant_to",
            "distant_e",
            "sky_axis",
            "sky_up",
            "sky_down",
            "area_at",
            "area_n",
            "area_e",
            "area_sides",
            "picture",
        ];
        // SAFETY: as above.
        let places = NAMES.map(|name| (name, unsafe { gl.get_uniform_location(program, name) })).into_iter().collect();
        Ok(Self { program, places })
    }

    fn place(&self, name: &str) -> Option<&glow::UniformLocation> {
        self.places.get(name)?.as_ref()
    }

    /// Of the program in use.
    fn set(&self, gl: &glow::Context, (name, values): &Uniform) {
        if !values.is_empty() {
            // SAFETY: the place is of the program in use, or none.
            unsafe { gl.uniform_3_f32_slice(self.place(name), values) };
        }
    }

    fn set_projection(&self, gl: &glow::Context, projection: &[[f32; 4]; 4]) {
        // SAFETY: the place is of the program in use, or none.
        unsafe { gl.uniform_matrix_4_f32_slice(self.place("projection"), false, projection.as_flattened()) };
    }
}

/// Batches whose indices follow each other and that have the same key: the key, the first index, and how many.
fn runs<'a, K: PartialEq>(
    batches: &'a [&Batch],
    key: impl Fn(&Batch) -> K + Copy + 'a,
) -> impl Iterator<Item = (K, usize, usize)> + 'a {
    batches
        .chunk_by(move |a, b| a.range.end == b.range.start && key(a) == key(b))
        .map(move |run| (key(run[0]), run[0].range.start, run.iter().map(|b| b.range.len()).sum()))
}

/// # Safety
/// The context is current, and its bound buffers hold such indices.
unsafe fn draw_run<K>(gl: &glow::Context, (_, first, n): (K, usize, usize)) {
    // SAFETY: the caller's promise.
    unsafe { gl.draw_elements(glow::TRIANGLES, n as i32, glow::UNSIGNED_INT, 4 * first as i32) };
}

/// From world coordinates to clip coordinates, column by column.
fn projection(stage: &Stage, near: f32) -> [[f32; 4]; 4] {
    let (eye, basis) = (stage.view.eye().as_dvec3(), &stage.camera.basis);
    let aspect = f64::from(stage.size.0) / f64::from(stage.size.1);
    let Projection::Perspective { fov_y } = stage.camera.projection else { return [[f32::NAN; 4]; 4] };
    let half = (0.5 * fov_y).tan();
    let along = |axis: radiosa::math::DVec3, scale: f64| [axis.x * scale, axis.y * scale, axis.z * scale, -axis.dot(eye) * scale];
    let rows = [
        along(basis.x_axis, 1.0 / (half * aspect)),
        along(basis.y_axis, 1.0 / half),
        [0.0, 0.0, 0.0, f64::from(near)],
        along(-basis.z_axis, 1.0),
    ];
    std::array::from_fn(|column| std::array::from_fn(|row| rows[row][column] as f32))
}

/// False for what lies wholly outside one side of the view, or behind the eye.
fn may_be_seen(batch: &Batch, projection: &[[f32; 4]; 4]) -> bool {
    let (lo, hi) = (batch.bounds.min, batch.bounds.max);
    let corners: [[f32; 4]; 8] = std::array::from_fn(|i| {
        let pick = |bit: usize, lo: f32, hi: f32| if i >> bit & 1 == 0 { lo } else { hi };
        let p = Vec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z));
        std::array::from_fn(|r| projection[0][r] * p.x + projection[1][r] * p.y + projection[2][r] * p.z + projection[3][r])
    });
    let outside: [fn(&[f32; 4]) -> bool; 5] =
        [|c| c[0] < -c[3], |c| c[0] > c[3], |c| c[1] < -c[3], |c| c[1] > c[3], |c| c[3] < 0.0];
    !outside.iter().any(|outside| corners.iter().all(outside))
}

fn bytes<T: Copy>(values: &[T]) -> &[u8] {
    // SAFETY: used for f32 and u32 only, which have no padding.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), std::mem::size_of_val(values)) }
}

fn bytes_mut(values: &mut [f32]) -> &mut [u8] {
    // SAFETY: any bytes are floats.
    unsafe { std::slice::from_raw_parts_mut(values.as_mut_ptr().cast(), std::mem::size_of_val(values)) }
}
