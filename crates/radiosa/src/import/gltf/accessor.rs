//! Accessors: typed arrays over bytes, every one checked against the bytes that are there before anything is allocated.

use super::super::ImportError;
use super::budget::Budget;
use super::buffer::Buffers;
use super::json::{Item, Table};

/// An accessor without bytes of its own (all zero but for sparse values) may have this many elements however small the file.
const FREE_ZEROS: u64 = 1 << 20;
/// … and this many for each byte of all buffers.
const ZEROS_PER_BYTE: u64 = 64;

/// The six storage types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(item: &Item<'_>) -> Result<Self, ImportError> {
        Ok(match item.as_count()? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => return Err(item.error(format!("{other} is no component type; they are 5120 to 5123, 5125 and 5126"))),
        })
    }

    const fn size(self) -> u64 {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// What normalised integers are divided by; 1 for others.
    const fn divisor(self, normalized: bool) -> f64 {
        match (self, normalized) {
            (Self::I8, true) => 127.0,
            (Self::U8, true) => 255.0,
            (Self::I16, true) => 32767.0,
            (Self::U16, true) => 65535.0,
            (Self::U32, true) => 4_294_967_295.0,
            _ => 1.0,
        }
    }
}

/// The accessors of a document.
#[derive(Debug)]
pub(super) struct Accessors<'a> {
    table: Table<'a>,
    buffers: Buffers<'a>,
}

/// Elements in memory.
#[derive(Clone, Copy)]
struct Strided<'b> {
    bytes: &'b [u8],
    stride: usize,
}

/// One accessor, checked.
pub(super) struct Accessor<'b, 'a> {
    item: Item<'a>,
    /// Number of elements.
    pub count: usize,
    width: usize,
    component: Component,
    normalized: bool,
    dense: Option<Strided<'b>>,
    sparse: Option<Sparse<'b>>,
}

struct Sparse<'b> {
    indices: Vec<u32>,
    values: Strided<'b>,
}

impl<'a> Accessors<'a> {
    pub(super) fn new(root: &Item<'a>, buffers: Buffers<'a>) -> Result<Self, ImportError> {
        Ok(Self { table: Table::new(root, "accessors", "accessor")?, buffers })
    }

    /// The buffers below.
    pub(super) fn buffers(&self) -> &Buffers<'a> {
        &self.buffers
    }

    /// Whether the accessor that `reference` means has bytes of its own.
    pub(super) fn has_bytes(&self, reference: &Item<'a>) -> Result<bool, ImportError> {
        let (_, item) = self.table.resolve(reference)?;
        Ok(item.has("bufferView") || item.has("sparse"))
    }

    /// Follows a reference and checks everything about the accessor but the values it holds.
    pub(super) fn get(&self, reference: &Item<'a>) -> Result<Accessor<'_, 'a>, ImportError> {
        let (_, item) = self.table.resolve(reference)?;
        let component = Component::new(&item.require("componentType")?)?;
        let kind = item.require("type")?;
        let width = match kind.as_text()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            other => return Err(kind.error(format!("{other:?} is no accessor type"))),
        };
        let declared = item.require("count")?;
        let count = declared.as_count()?;
        let size = component.size() * width;
        let offset = item.count("byteOffset")?.unwrap_or(0);
        let dense = match item.get("bufferView")? {
            Some(view) => Some(self.strided(&view, &item, offset, count, size)?),
            None => {
                let limit = FREE_ZEROS.max(self.buffers.total().saturating_mul(ZEROS_PER_BYTE));
                if count > limit {
                    return Err(declared.error(format!("{count} elements without a buffer view, more than the {limit} allowed")));
                }
                None
            }
        };
        let sparse = match item.object("sparse")? {
            Some(sparse) => Some(self.sparse(&sparse, count, size)?),
            None => None,
        };
        let normalized = item.flag("normalized")?.unwrap_or(false);
        // Every count is now bounded by bytes that exist or by the limit above, so it fits.
        Ok(Accessor { item, count: count as usize, width: width as usize, component, normalized, dense, sparse })
    }

    fn strided(&self, view: &Item<'a>, owner: &Item<'a>, offset: u64, count: u64, size: u64) -> Result<Strided<'_>, ImportError> {
        let found = self.buffers.view(view)?;
        let stride = found.stride.unwrap_or(size);
        if stride < size {
            return Err(view.error(format!("the view's byteStride of {stride} is less than the {size} bytes of an element")));
        }
        let available = found.bytes.len() as u64;
        let end = match count.checked_sub(1) {
            None => Some(offset),
            Some(last) => last.checked_mul(stride).and_then(|n| n.checked_add(size)).and_then(|n| n.checked_add(offset)),
        };
        let Some(end) = end.filter(|&end| end <= available) else {
            let message =
                format!("{count} elements of {size} bytes, {stride} apart from byte {offset}, leave a view of {available}");
            return Err(owner.error_with_help(message, "the file may be truncated or damaged; fetch or export it again"));
        };
        Ok(Strided { bytes: &found.bytes[offset as usize..end as usize], stride: stride as usize })
    }

    fn sparse(&self, sparse: &Item<'a>, count: u64, size: u64) -> Result<Sparse<'_>, ImportError> {
        let n = sparse.require("count")?.as_count()?;
        let place = sparse.require("indices")?;
        let component = Component::new(&place.require("componentType")?)?;
        if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
            return Err(place.error("sparse indices must be unsigned integers"));
        }
        let at = |item: &Item<'a>| Ok::<_, ImportError>(item.count("byteOffset")?.unwrap_or(0));
        let offset = at(&place)?;
        let strided = self.strided(&place.require("bufferView")?, &place, offset, n, component.size())?;
        let mut indices = Vec::with_capacity(n as usize);
        for i in 0..n as usize {
            let index = unsigned(component, &strided.bytes[i * strided.stride..]);
            if u64::from(index) >= count {
                return Err(place.error(format!("sparse index {index} of an accessor with {count} elements")));
            }
            indices.push(index);
        }
        let place = sparse.require("values")?;
        let offset = at(&place)?;
        Ok(Sparse { indices, values: self.strided(&place.require("bufferView")?, &place, offset, n, size)? })
    }
}

/// One unsigned integer from the start of some bytes.
fn unsigned(component: Component, b: &[u8]) -> u32 {
    match component {
        Component::U8 => u32::from(b[0]),
        Component::U16 => u32::from(u16::from_le_bytes([b[0], b[1]])),
        _ => u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
    }
}

impl Accessor<'_, '_> {
    /// An error about this accessor.
    pub(super) fn error(&self, message: impl Into<String>) -> ImportError {
        self.item.error(message)
    }

    /// Components of one element.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Reads vertex or triangle indices, or joint numbers' components: unsigned integers as they are.
    pub(super) fn read_unsigned<const N: usize>(&self, budget: &mut Budget) -> Result<Vec<[u32; N]>, ImportError> {
        if !matches!(self.component, Component::U8 | Component::U16 | Component::U32) {
            return Err(self.item.error("unsigned integers are needed here"));
        }
        let (component, size) = (self.component, self.component.size() as usize);
        self.read(N, budget, [0; N], |b| std::array::from_fn(|k| unsigned(component, &b[k * size..])))
    }

    /// Reads numbers: floats as they are, integers as whole numbers or, normalised, from `[0, 1]` or `[−1, 1]`.
    ///
    /// `convert` makes what is stored of them.
    pub(super) fn read_numbers<const N: usize, T: Copy>(
        &self,
        budget: &mut Budget,
        convert: impl Fn([f64; N]) -> T,
    ) -> Result<Vec<T>, ImportError> {
        let zero = convert([0.0; N]);
        let divisor = self.component.divisor(self.normalized);
        // The most negative integer lies just outside; the specification clamps it.
        let scaled = |v: f64| if divisor == 1.0 { v } else { (v / divisor).max(-1.0) };
        match self.component {
            Component::F32 => self.read(N, budget, zero, |b| {
                convert(std::array::from_fn(|k| {
                    f64::from(f32::from_le_bytes([b[4 * k], b[4 * k + 1], b[4 * k + 2], b[4 * k + 3]]))
                }))
            }),
            Component::I8 => self.read(N, budget, zero, |b| convert(std::array::from_fn(|k| scaled(f64::from(b[k] as i8))))),
            Component::U8 => self.read(N, budget, zero, |b| convert(std::array::from_fn(|k| scaled(f64::from(b[k]))))),
            Component::I16 => self.read(N, budget, zero, |b| {
                convert(std::array::from_fn(|k| scaled(f64::from(i16::from_le_bytes([b[2 * k], b[2 * k + 1]])))))
            }),
            Component::U16 => self.read(N, budget, zero, |b| {
                convert(std::array::from_fn(|k| scaled(f64::from(u16::from_le_bytes([b[2 * k], b[2 * k + 1]])))))
            }),
            Component::U32 => self.read(N, budget, zero, |b| {
                convert(std::array::from_fn(|k| scaled(f64::from(unsigned(Component::U32, &b[4 * k..])))))
            }),
        }
    }

    /// Reads elements of exactly `width` components, `decode` seeing the bytes of each.
    fn read<T: Copy>(
        &self,
        width: usize,
        budget: &mut Budget,
        zero: T,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, ImportError> {
        if self.width != width {
            return Err(self.item.error(format!("elements of {width} numbers are needed here, not of {}", self.width)));
        }
        let bytes = (self.count as u64).saturating_mul(size_of::<T>() as u64);
        budget.reserve(&|| format!("accessor {}", self.item.pointer()), bytes)?;
        let size = self.component.size() as usize * self.width;
        let mut out = match self.dense {
            None => vec![zero; self.count],
            Some(Strided { bytes, stride }) => (0..self.count).map(|i| decode(&bytes[i * stride..i * stride + size])).collect(),
        };
        if let Some(sparse) = &self.sparse {
            let Strided { bytes, stride } = sparse.values;
            for (i, &index) in sparse.indices.iter().enumerate() {
                out[index as usize] = decode(&bytes[i * stride..i * stride + size]);
            }
        }
        Ok(out)
    }
}
