//! Telling pictures apart by their first bytes.

use std::fmt;

/// What a file of bytes looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Png,
    Jpeg,
    WebP,
    Hdr,
    Exr,
    /// Something known that is not read, in words for a message.
    Other(&'static str),
    Unknown,
}

/// What to do about a picture that cannot be read.
pub(super) const HELP: &str = "use PNG, JPEG, WebP, Radiance HDR or OpenEXR";

/// First bytes (at an offset) and what they mean.
const MARKS: &[(usize, &[u8], Kind)] = &[
    (0, b"\x89PNG\r\n\x1a\n", Kind::Png),
    (0, b"\xff\xd8\xff", Kind::Jpeg),
    (8, b"WEBP", Kind::WebP),
    (0, b"#?", Kind::Hdr),
    (0, b"\x76\x2f\x31\x01", Kind::Exr),
    (0, b"BM", Kind::Other("BMP pictures")),
    (0, b"DDS ", Kind::Other("DDS textures")),
    (0, b"\xabKTX 20\xbb", Kind::Other("KTX2 textures")),
    (0, b"\xabKTX", Kind::Other("KTX textures")),
    (0, b"sB", Kind::Other("Basis textures")),
    (0, b"II*\0", Kind::Other("TIFF pictures")),
    (0, b"MM\0*", Kind::Other("TIFF pictures")),
    (0, b"GIF8", Kind::Other("GIF pictures")),
    (0, b"8BPS", Kind::Other("Photoshop documents")),
    (0, b"\0\0\x01\0", Kind::Other("ICO icons")),
    (0, b"\0\0\x02\0", Kind::Other("CUR cursors")),
    (4, b"ftypavif", Kind::Other("AVIF pictures")),
    (4, b"ftyp", Kind::Other("HEIF pictures and films")),
    (0, b"\xff\x0a", Kind::Other("JPEG XL pictures")),
    (0, b"\0\0\0\x0cJXL ", Kind::Other("JPEG XL pictures")),
    (0, b"\0\0\0\x0cjP", Kind::Other("JPEG 2000 pictures")),
    (0, b"P3", Kind::Other("PPM pictures")),
    (0, b"P6", Kind::Other("PPM pictures")),
    (0, b"PF\n", Kind::Other("PFM pictures")),
    (0, b"qoif", Kind::Other("QOI pictures")),
    (0, b"<svg", Kind::Other("SVG drawings")),
    (0, b"%PDF", Kind::Other("PDF documents")),
    (0, b"<!DOCTYPE", Kind::Other("web pages (was the picture really downloaded?)")),
    (0, b"<html", Kind::Other("web pages (was the picture really downloaded?)")),
    (0, b"version https://git-lfs", Kind::Other("Git LFS pointers (run `git lfs pull`)")),
];

impl Kind {
    /// What these bytes start like.
    pub(super) fn of(bytes: &[u8]) -> Self {
        let starts = |&(at, mark, _): &(usize, &[u8], Self)| bytes.get(at..).is_some_and(|rest| rest.starts_with(mark));
        MARKS.iter().find(|mark| starts(mark)).map_or(Self::Unknown, |mark| mark.2)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Png => "PNG picture",
            Self::Jpeg => "JPEG picture",
            Self::WebP => "WebP picture",
            Self::Hdr => "Radiance picture",
            Self::Exr => "OpenEXR picture",
            Self::Other(_) | Self::Unknown => "picture",
        })
    }
}
