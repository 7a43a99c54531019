//! Results as a stream of numbers, to be kept and gone on with: arrays behind their lengths, little-endian.
//!
//! Nothing is believed of what is read: an array grows as its values arrive, and who reads says how long it has to be.

use std::io::{self, Read, Write};

use bytemuck::{AnyBitPattern, NoUninit};

/// Numbers on their way out.
pub struct Out<'a>(pub &'a mut dyn Write);

impl Out<'_> {
    /// One number.
    ///
    /// # Errors
    /// When the stream ends.
    pub fn number(&mut self, value: u64) -> io::Result<()> {
        self.0.write_all(&value.to_le_bytes())
    }

    /// An array with its length.
    ///
    /// # Errors
    /// When the stream cannot take it.
    pub fn array<T: NoUninit>(&mut self, values: &[T]) -> io::Result<()> {
        self.number(values.len() as u64)?;
        self.0.write_all(bytemuck::cast_slice(values))
    }
}

/// Numbers on their way in.
pub struct In<'a>(pub &'a mut dyn Read);

/// Values read at once.
const PIECE: usize = 1 << 16;

impl In<'_> {
    /// One number.
    ///
    /// # Errors
    /// When the stream ends.
    pub fn number(&mut self) -> io::Result<u64> {
        let mut bytes = [0; 8];
        self.0.read_exact(&mut bytes)?;
        Ok(u64::from_le_bytes(bytes))
    }

    /// An array of any length.
    ///
    /// # Errors
    /// When the stream ends.
    pub fn any_array<T: AnyBitPattern + NoUninit>(&mut self) -> io::Result<Vec<T>> {
        let n = self.number()?;
        self.values(n)
    }

    /// `left` values.
    fn values<T: AnyBitPattern + NoUninit>(&mut self, mut left: u64) -> io::Result<Vec<T>> {
        let mut values = Vec::new();
        while left > 0 {
            let n = left.min(PIECE as u64);
            let old = values.len();
            values.resize(old + n as usize, T::zeroed());
            self.0.read_exact(bytemuck::cast_slice_mut(&mut values[old..]))?;
            left -= n;
        }
        Ok(values)
    }

    /// Bytes, at most `most`.
    ///
    /// # Errors
    /// When the stream ends, or there are more.
    pub fn bytes(&mut self, most: u64) -> io::Result<Vec<u8>> {
        let n = self.number()?;
        if n <= most { self.values(n) } else { Err(wrong("a text is too long")) }
    }

    /// An array of `n` values.
    ///
    /// # Errors
    /// When the stream ends, or holds another number of them.
    pub fn array<T: AnyBitPattern + NoUninit>(&mut self, n: usize) -> io::Result<Vec<T>> {
        if self.number()? != n as u64 {
            return Err(wrong("an array has another length than it should"));
        }
        self.values(n as u64)
    }
}

/// What was read cannot be.
pub(crate) fn wrong(why: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why)
}
