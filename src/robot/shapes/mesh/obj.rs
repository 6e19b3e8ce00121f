//! OBJ meshes: points and faces as text.

use nalgebra::Vector3;

use super::{MeshFlaw, point};

/// All points. Which of them are corners of faces does not matter.
pub(super) fn points(bytes: &[u8]) -> Result<Vec<Vector3<f64>>, MeshFlaw> {
    let mut points = Vec::new();
    for (line, number) in String::from_utf8_lossy(bytes).lines().zip(1..) {
        let mut words = line.split_whitespace();
        if words.next() == Some("v") {
            points.push(point(&mut words, number)?);
        }
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Normals and texture coordinates are not points; colours may follow the coordinates of a point.
    #[test]
    fn points_are_lines_that_begin_with_v() {
        let text =
            "# cube\no cube\nv 0 0 0\r\nv 1.5 -2e-1 0 1 0 0\nvn 0 0 9\nvt 7 7\nf 1//1 2//1 1\n";
        let expected = vec![Vector3::zeros(), Vector3::new(1.5, -0.2, 0.0)];
        assert_eq!(points(text.as_bytes()), Ok(expected));
        let said = |text: &str| points(text.as_bytes()).unwrap_err().to_string();
        assert_eq!(said("v 0 0 0\nv 1 x 0\n"), "line 2: \"x\" is no number");
        assert_eq!(said("v 0 0 0\nv 1 2"), "line 2: a point has three numbers");
        assert_eq!(points(b""), Ok(Vec::new()));
    }

    proptest! {
        #[test]
        fn no_garbage_makes_it_panic(text in "[v0-9. e\n\\-]{0,200}") {
            let _ = points(text.as_bytes());
        }
    }
}
