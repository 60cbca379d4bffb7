//! Numbers out of buffers. Every bound is checked before anything is read or allocated.

use super::{at::At, buffers::Buffers};
use crate::{Error, Result};

/// How many elements an accessor without any data of its own may have.
const MAX_WITHOUT_DATA: u64 = 1 << 20;

/// Elements of a buffer view, certain to be inside it.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> + use<'_, 'a> {
        (0..self.count).map_while(|i| self.bytes.get(i * self.stride..i * self.stride + self.size))
    }
}

impl Buffers<'_> {
    /// The elements of an accessor of `N` components as numbers; integers that are normalised lie in [-1, 1].
    pub fn numbers<const N: usize>(&self, index: usize, at: At, what: &str) -> Result<Vec<[f64; N]>> {
        let accessor = self.accessor(index, at, what)?;
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"].get(N).copied().unwrap_or_default();
        if accessor.kind != kind {
            return Err(wrong(at, what, format!("accessor {index} of type {:?}", accessor.kind), format!("type {kind}")));
        }
        let width = component_size(accessor.component_type).ok_or_else(|| {
            wrong(at, what, format!("of component type {}", accessor.component_type), "5120 to 5123, 5125 or 5126".into())
        })?;
        let size = width * N;
        let decode = |bytes: &[u8]| -> [f64; N] {
            let mut parts = bytes.chunks_exact(width);
            std::array::from_fn(|_| parts.next().map_or(f64::NAN, |part| component(part, accessor.component_type, accessor.normalized)))
        };
        let mut values: Vec<[f64; N]> = match accessor.buffer_view {
            Some(view) => self.elements(view, accessor.byte_offset, accessor.count, size, at, what)?.iter().map(decode).collect(),
            None if accessor.count <= MAX_WITHOUT_DATA && accessor.sparse.is_some() => vec![[0.0; N]; accessor.count as usize],
            None => {
                let draco = self.root.extensions_used.iter().any(|e| e == "KHR_draco_mesh_compression");
                let fix = if draco { "The file is Draco-compressed: export again with Compression off" } else { "Export the file again" };
                return Err(at.error(
                    what,
                    format!("accessor {index} with {} elements and no data", accessor.count),
                    "a `bufferView`",
                    fix,
                ));
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let kind = sparse.indices.component_type;
            let width = index_size(kind)
                .ok_or_else(|| wrong(at, what, format!("sparse indices of component type {kind}"), "5121, 5123 or 5125".into()))?;
            let places = self.elements(sparse.indices.buffer_view, sparse.indices.byte_offset, sparse.count, width, at, what)?;
            let news = self.elements(sparse.values.buffer_view, sparse.values.byte_offset, sparse.count, size, at, what)?;
            for (place, new) in places.iter().zip(news.iter()) {
                let place = integer(place) as usize;
                let count = values.len();
                let Some(slot) = values.get_mut(place) else {
                    return Err(wrong(at, what, format!("a sparse index {place}"), format!("less than the count {count}")));
                };
                *slot = decode(new);
            }
        }
        Ok(values)
    }

    /// The elements of an accessor of indices, each less than `limit`.
    pub fn indices(&self, index: usize, limit: usize, at: At) -> Result<Vec<u32>> {
        let what = "indices";
        let accessor = self.accessor(index, at, what)?;
        let size = index_size(accessor.component_type).filter(|_| accessor.kind == "SCALAR").ok_or_else(|| {
            let found = format!("accessor {index} of type {:?} and component type {}", accessor.kind, accessor.component_type);
            wrong(at, what, found, "type SCALAR and component type 5121, 5123 or 5125".into())
        })?;
        let Some(view) = accessor.buffer_view else {
            return Err(wrong(at, what, format!("accessor {index} without data"), "a `bufferView`".into()));
        };
        if accessor.sparse.is_some() {
            return Err(wrong(at, what, format!("sparse (accessor {index})"), "plain indices".into()));
        }
        let indices: Vec<u32> = self.elements(view, accessor.byte_offset, accessor.count, size, at, what)?.iter().map(integer).collect();
        match indices.iter().find(|&&i| i as usize >= limit) {
            Some(bad) => Err(wrong(at, what, format!("{bad} (accessor {index})"), format!("less than the number of vertices, {limit}"))),
            None => Ok(indices),
        }
    }

    fn accessor(&self, index: usize, at: At, what: &str) -> Result<&super::json::Accessor> {
        let count = self.root.accessors.len();
        self.root
            .accessors
            .get(index)
            .ok_or_else(|| wrong(at, what, format!("accessor {index}, out of bounds"), format!("one of the file's {count} accessors")))
    }

    fn elements(&self, view_index: usize, offset: u64, count: u64, size: usize, at: At, what: &str) -> Result<Elements<'_>> {
        let views = self.root.buffer_views.len();
        let view = self.root.buffer_views.get(view_index).ok_or_else(|| {
            wrong(at, what, format!("buffer view {view_index}, out of bounds"), format!("one of the file's {views} buffer views"))
        })?;
        let stride = if view.byte_stride == 0 { size as u64 } else { view.byte_stride };
        if stride < size as u64 {
            return Err(wrong(at, what, format!("a stride of {stride} bytes"), format!("at least {size}, the size of an element")));
        }
        let buffer = self.bytes(view.buffer, at)?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes =
            end.and_then(|end| buffer.get(usize::try_from(view.byte_offset).ok()?..usize::try_from(end).ok()?)).ok_or_else(|| {
                let found = format!("buffer view {view_index}, out of bounds: {} bytes from {}", view.byte_length, view.byte_offset);
                wrong(at, what, found, format!("inside the {} bytes of buffer {}", buffer.len(), view.buffer))
            })?;
        let needed = match count.checked_sub(1) {
            None => Some(offset),
            Some(gaps) => gaps.checked_mul(stride).and_then(|n| n.checked_add(size as u64)).and_then(|n| n.checked_add(offset)),
        };
        let fits = needed.filter(|&needed| needed <= bytes.len() as u64).and_then(|_| bytes.get(usize::try_from(offset).ok()?..));
        let bytes = fits.ok_or_else(|| {
            let found = format!("an accessor out of bounds: {count} elements, {stride} bytes apart, from byte {offset}");
            wrong(at, what, found, format!("inside the {} bytes of buffer view {view_index}", bytes.len()))
        })?;
        Ok(Elements { bytes, stride: stride as usize, size, count: count as usize })
    }
}

fn wrong(at: At, what: &str, found: String, expected: String) -> Error {
    at.error(what, found, expected, "The file is damaged or cut short: export it again")
}

fn component_size(kind: u64) -> Option<usize> {
    Some(match kind {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        5125 | 5126 => 4,
        _ => return None,
    })
}

fn index_size(kind: u64) -> Option<usize> {
    component_size(kind).filter(|_| matches!(kind, 5121 | 5123 | 5125))
}

/// An unsigned integer of one, two or four bytes.
fn integer(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |n, &b| (n << 8) | u32::from(b))
}

/// One number; the bytes are as many as its type needs.
fn component(bytes: &[u8], kind: u64, normalized: bool) -> f64 {
    let (value, most) = match (kind, bytes) {
        (5126, &[a, b, c, d]) => return f64::from(f32::from_le_bytes([a, b, c, d])),
        (5120, &[a]) => (f64::from(a as i8), 127.0),
        (5121, &[a]) => (f64::from(a), 255.0),
        (5122, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])), 32767.0),
        (5123, &[a, b]) => (f64::from(u16::from_le_bytes([a, b])), 65535.0),
        (5125, &[a, b, c, d]) => (f64::from(u32::from_le_bytes([a, b, c, d])), f64::from(u32::MAX)),
        _ => (f64::NAN, 1.0),
    };
    if normalized { (value / most).max(-1.0) } else { value }
}
