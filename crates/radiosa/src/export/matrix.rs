//! Form factors as files.
//!
//! | ending | content |
//! |---|---|
//! | `.csv` | `from,to,area_from,factor,stderr`: one line for each factor above zero, by rising row and column |
//! | `.mtx` | MatrixMarket, coordinate, real, general; rows and columns from 1, names and areas in its comments |
//! | `.npz` | NumPy: `indptr`, `indices`, `data`, `shape`, `format`, as SciPy's `load_npz` reads it, and `stderr`, `area`, `names` |

use std::io::{self, Write};
use std::path::Path;

use super::target::check_writable;
use super::{ExportError, write_atomically};
use crate::radiosity::between::Between;

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values.
    Csv,
    /// MatrixMarket.
    MatrixMarket,
    /// NumPy's archive of arrays.
    Npz,
}

impl Format {
    /// What the ending of a path says.
    ///
    /// # Errors
    /// When it says nothing known.
    pub fn of(path: &Path) -> Result<Self, ExportError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("mtx") => Ok(Self::MatrixMarket),
            Some("npz") => Ok(Self::Npz),
            _ => Err(ExportError::UnknownEnding { path: path.to_path_buf(), known: &["csv", "mtx", "npz"] }),
        }
    }
}

/// Finds out whether a matrix can be written to `path`.
///
/// # Errors
/// When the ending is unknown or the folder does not let us write.
pub fn check_target(path: &Path) -> Result<Format, ExportError> {
    let format = Format::of(path)?;
    check_writable(path)?;
    Ok(format)
}

/// Writes factors between groups of these names in the format the ending says. `path` holds the whole file or what it held before.
///
/// # Errors
/// When the ending is unknown or the file cannot be written.
pub fn write(between: &Between, names: &[String], path: &Path) -> Result<(), ExportError> {
    match Format::of(path)? {
        Format::Csv => write_atomically(path, |file| csv(between, names, file)),
        Format::MatrixMarket => write_atomically(path, |file| matrix_market(between, names, file)),
        Format::Npz => write_atomically(path, |file| npz(between, names, file)),
    }
}

/// A field, quoted where it has to be.
fn field(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.to_owned() }
}

fn csv(between: &Between, names: &[String], file: &mut impl Write) -> io::Result<()> {
    writeln!(file, "from,to,area_from,factor,stderr")?;
    let names: Vec<String> = names.iter().map(|n| field(n)).collect();
    for i in 0..between.n() {
        for entry in between.row(i) {
            let [factor, stderr] = between.factor(i, entry);
            writeln!(file, "{},{},{},{factor},{}", names[i], names[entry.to as usize], between.areas[i], stderr as f32)?;
        }
    }
    Ok(())
}

fn matrix_market(between: &Between, names: &[String], file: &mut impl Write) -> io::Result<()> {
    writeln!(file, "%%MatrixMarket matrix coordinate real general")?;
    writeln!(file, "% form factors, from row to column; number, area in m², name:")?;
    for (i, (area, name)) in between.areas.iter().zip(names).enumerate() {
        writeln!(file, "% {} {area} {}", i + 1, name.replace(['\n', '\r'], " "))?;
    }
    writeln!(file, "{} {} {}", between.n(), between.n(), between.n_entries())?;
    for i in 0..between.n() {
        for entry in between.row(i) {
            writeln!(file, "{} {} {}", i + 1, entry.to + 1, between.factor(i, entry)[0])?;
        }
    }
    Ok(())
}

fn npz(between: &Between, names: &[String], file: &mut impl Write) -> io::Result<()> {
    let n = between.n();
    let mut zip = Zip { file, at: 0, directory: Vec::new(), n: 0 };
    let entries = || (0..n).flat_map(|i| between.row(i).iter().map(move |e| (i, e)));
    zip.array("format", "|S3", &[], std::iter::once(*b"csr"))?;
    zip.array("shape", "<i8", &[2], [n as i64; 2].map(i64::to_le_bytes).into_iter())?;
    zip.array("indptr", "<i8", &[n + 1], between.starts().iter().map(|&start| (start as i64).to_le_bytes()))?;
    zip.array("indices", "<i4", &[between.n_entries()], entries().map(|(_, e)| (e.to as i32).to_le_bytes()))?;
    zip.array("data", "<f8", &[between.n_entries()], entries().map(|(i, e)| between.factor(i, e)[0].to_le_bytes()))?;
    let stderr = entries().map(|(i, e)| (between.factor(i, e)[1] as f32).to_le_bytes());
    zip.array("stderr", "<f4", &[between.n_entries()], stderr)?;
    zip.array("area", "<f8", &[n], between.areas.iter().map(|a| a.to_le_bytes()))?;
    // Unicode of fixed width, four bytes a character.
    let width = names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(1);
    let padded = names.iter().flat_map(|name| name.chars().map(|c| c as u32).chain(std::iter::repeat(0)).take(width));
    zip.array("names", &format!("<U{width}"), &[n], padded.map(u32::to_le_bytes))?;
    zip.finish()
}

/// A ZIP archive without compression whose sizes have 64 bits.
struct Zip<'a, W> {
    file: &'a mut W,
    at: u64,
    /// The central directory as it grows.
    directory: Vec<u8>,
    n: u64,
}

/// Local headers and the central directory say version 4.5, no compression, the first day of ZIP.
const VERSION: [u8; 2] = 45u16.to_le_bytes();
const TIME: [u8; 4] = [0, 0, 0x21, 0];

impl<W: Write> Zip<'_, W> {
    /// Adds `NAME.npy`; its values are gone through twice, since the checksum comes first.
    fn array<const N: usize>(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        values: impl Iterator<Item = [u8; N]> + Clone,
    ) -> io::Result<()> {
        let shape: String = shape.iter().map(|n| format!("{n},")).collect();
        let head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
        // The header ends with a line feed and fills whole blocks of 64 bytes.
        let length = (10 + head.len() + 1).next_multiple_of(64) - 10;
        let mut npy = b"\x93NUMPY\x01\x00".to_vec();
        npy.extend((length as u16).to_le_bytes());
        npy.extend(format!("{head:<width$}\n", width = length - 1).bytes());
        let mut checksum = Checksum::new();
        checksum.add(&npy);
        let mut size = npy.len() as u64;
        for value in values.clone() {
            checksum.add(&value);
            size += N as u64;
        }
        let name = format!("{name}.npy");
        let (checksum, size, offset) = (checksum.value().to_le_bytes(), size.to_le_bytes(), self.at.to_le_bytes());
        let name_length = (name.len() as u16).to_le_bytes();
        let common = [&VERSION[..], &[0; 4], &TIME, &checksum, &[0xFF; 8], &name_length].concat();
        let local = [b"PK\x03\x04", &common[..], &[20, 0], name.as_bytes(), &[1, 0, 16, 0], &size, &size].concat();
        self.put(&local)?;
        self.put(&npy)?;
        for value in values {
            self.put(&value)?;
        }
        let directory = [
            b"PK\x01\x02",
            &VERSION[..],
            &common,
            &[28, 0],
            &[0; 10],
            &[0xFF; 4],
            name.as_bytes(),
            &[1, 0, 24, 0],
            &size,
            &size,
            &offset,
        ];
        self.directory.extend(directory.concat());
        self.n += 1;
        Ok(())
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.at += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    fn finish(mut self) -> io::Result<()> {
        let (start, directory) = (self.at, std::mem::take(&mut self.directory));
        self.put(&directory)?;
        let (n, size, end) = (self.n.to_le_bytes(), (directory.len() as u64).to_le_bytes(), self.at.to_le_bytes());
        let start = start.to_le_bytes();
        let end64 = [b"PK\x06\x06", &44u64.to_le_bytes()[..], &VERSION, &VERSION, &[0; 8], &n, &n, &size, &start].concat();
        self.put(&end64)?;
        self.put(&[b"PK\x06\x07", &[0; 4][..], &end, &1u32.to_le_bytes()].concat())?;
        self.put(&[b"PK\x05\x06", &[0; 4][..], &[0xFF; 12], &[0; 2]].concat())
    }
}

/// CRC-32 as ZIP has it.
struct Checksum {
    table: [u32; 256],
    state: u32,
}

impl Checksum {
    fn new() -> Self {
        let entry = |i: usize| (0..8).fold(i as u32, |c, _| if c & 1 == 1 { 0xEDB8_8320 ^ (c >> 1) } else { c >> 1 });
        Self { table: std::array::from_fn(entry), state: u32::MAX }
    }

    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.state = self.table[((self.state ^ u32::from(*byte)) & 0xFF) as usize] ^ (self.state >> 8);
        }
    }

    fn value(&self) -> u32 {
        !self.state
    }
}
