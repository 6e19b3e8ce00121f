//! STL meshes: triangles, in binary or in text.

use nalgebra::Vector3;

use super::{MeshFlaw, point};

/// Number of bytes of the header, and of the number of triangles that follows it.
const HEADER: usize = 80;
const COUNT: usize = 4;
/// Number of bytes of a triangle: four vectors of three 4-byte numbers, the first of which is the normal, and two more
/// bytes.
const TRIANGLE: usize = 50;
const VECTOR: usize = 12;

/// The corners of all triangles.
pub(super) fn points(bytes: &[u8]) -> Result<Vec<Vector3<f64>>, MeshFlaw> {
    // A binary file may begin like a text file; it is binary if its length matches the number of triangles.
    let is_text = bytes.trim_ascii_start().starts_with(b"solid");
    let count = bytes.get(HEADER..HEADER + COUNT).and_then(|four| <[u8; 4]>::try_from(four).ok());
    let announced = count.map(|four| u32::from_le_bytes(four) as usize);
    let triangles_of = bytes.get(HEADER + COUNT..).unwrap_or_default();
    match announced {
        Some(triangles) if !is_text || triangles_of.len() == triangles.saturating_mul(TRIANGLE) => {
            binary(triangles_of, triangles)
        }
        _ if is_text => text(&String::from_utf8_lossy(bytes)),
        _ => Err(MeshFlaw::NoStl),
    }
}

fn binary(bytes: &[u8], triangles: usize) -> Result<Vec<Vector3<f64>>, MeshFlaw> {
    let room = bytes.len() / TRIANGLE;
    if triangles > room {
        return Err(MeshFlaw::CutOff { triangles, room });
    }
    let number = |four: &[u8]| {
        <[u8; 4]>::try_from(four).map_or(f64::NAN, |four| f64::from(f32::from_le_bytes(four)))
    };
    let corner = |twelve: &[u8]| Vector3::from_fn(|i, _| number(&twelve[4 * i..4 * i + 4]));
    let corners = bytes
        .chunks_exact(TRIANGLE)
        .take(triangles)
        .flat_map(|triangle| triangle[VECTOR..4 * VECTOR].chunks_exact(VECTOR));
    Ok(corners.map(corner).collect())
}

fn text(text: &str) -> Result<Vec<Vector3<f64>>, MeshFlaw> {
    let mut points = Vec::new();
    let mut has_end = false;
    for (line, number) in text.lines().zip(1..) {
        let mut words = line.split_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => points.push(point(&mut words, number)?),
            Some("endsolid") => has_end = true,
            _ => {}
        }
    }
    if has_end { Ok(points) } else { Err(MeshFlaw::NoEnd) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::robot::shapes::tests::binary_stl;

    const TEXT: &str = "solid plate\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1e-1 0 0\n   \
        vertex 0 0.25 0\n  endloop\n endfacet\nendsolid plate\n";

    fn triangle() -> [Vector3<f64>; 3] {
        [Vector3::zeros(), Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.0, 0.25, 0.0)]
    }

    #[test]
    fn words_and_bytes_are_the_same_triangle() {
        assert_eq!(points(TEXT.as_bytes()).unwrap(), triangle());
        let bytes = binary_stl("made by hand", &[triangle()]);
        // 0.1 is stored in single precision.
        for (found, expected) in points(&bytes).unwrap().iter().zip(triangle()) {
            assert!((found - expected).amax() < 1e-8, "{found}");
        }
        // Some programs begin a binary file with the word `solid`.
        assert_eq!(points(&binary_stl("solid", &[triangle()])).unwrap(), points(&bytes).unwrap());
    }

    #[test]
    fn a_damaged_file_is_told_as_what_it_is() {
        let said = |bytes: &[u8]| points(bytes).unwrap_err().to_string();
        let bytes = binary_stl("made by hand", &[triangle(), triangle()]);
        let cut = said(&bytes[..bytes.len() - 1]);
        assert!(cut.contains("announces 2 triangles and has room for 1"), "{cut}");
        let mut huge = bytes.clone();
        huge[HEADER..HEADER + COUNT].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(said(&huge).contains("announces 4294967295 triangles"), "{}", said(&huge));
        assert!(said(&TEXT.as_bytes()[..100]).contains("without endsolid"));
        let word = said(TEXT.replace("0.25", "O.25").as_bytes());
        assert_eq!(word, "line 6: \"O.25\" is no number");
        assert!(said(TEXT.replace(" 0.25 0", "").as_bytes()).contains("line 6: a point has three"));
        assert!(said(b"").contains("no STL") && said(b"<?xml").contains("no STL"));
        // A file without points is reported the same way for every format.
        assert_eq!(points(b"solid\nendsolid\n"), Ok(Vec::new()));
        assert_eq!(points(&binary_stl("", &[])), Ok(Vec::new()));
    }

    proptest! {
        #[test]
        fn no_garbage_makes_it_panic(
            bytes in prop::collection::vec(any::<u8>(), 0..300),
            is_text in any::<bool>(),
        ) {
            let begin: &[u8] = if is_text { b"solid\nvertex " } else { b"" };
            let _ = points(&[begin, bytes.as_slice()].concat());
        }
    }
}
