//! The cable shapes of a solution for other programs: as CSV, and as VTK `PolyData` for `ParaView`.

use std::fmt::{Display, Write as _};

use nalgebra::Vector3;

use crate::enumerate::Request;
use crate::shape::{ShapePoint, Shapes};

/// The points of all cables, a row each; schematic for slack cables of some models ([`Request::shapes`]).
///
/// # Errors
/// [`csv::Error`], which a table in memory never meets.
pub fn csv(shapes: &Shapes) -> Result<Vec<u8>, csv::Error> {
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(["cable", "s_m", "x_m", "y_m", "z_m", "tension_n"])?;
    for (cable, points) in (1..).zip(shapes) {
        for ShapePoint { rest_length_m, position_m: p, tension_n } in points {
            table.serialize((cable, rest_length_m, p.x, p.y, p.z, tension_n))?;
        }
    }
    table.into_inner().map_err(|fault| fault.into_error().into())
}

/// A `.vtp` file: a polyline for each cable and a polygon for the platform, whose corners are the attachments
/// in their order around its z axis. Points have `tension_n` and `s_m` (rest length from the anchor), cells
/// `cable` (from 1; 0 is the platform) and `rest_length_m`. Schematic for slack cables of some models
/// ([`Request::shapes`]).
#[must_use]
pub fn vtp(request: &Request, shapes: &Shapes) -> String {
    let points: Vec<&ShapePoint> = shapes.iter().flatten().collect();
    // Where the cables end among all points.
    let ends: Vec<usize> = shapes
        .iter()
        .scan(0, |end, shape| {
            *end += shape.len();
            Some(*end)
        })
        .collect();
    let corners: Vec<usize> = outline(request).into_iter().map(|cable| ends[cable] - 1).collect();
    let lengths = shapes.iter().map(|shape| shape.last().map_or(0.0, |end| end.rest_length_m));

    let mut out = format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\n<PolyData>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"{}\" NumberOfStrips=\"0\" \
         NumberOfPolys=\"1\">\n",
        points.len(),
        shapes.len(),
    );
    out += "<PointData Scalars=\"tension_n\">\n";
    array(&mut out, "Float64", "tension_n", 1, points.iter().map(|point| point.tension_n));
    array(&mut out, "Float64", "s_m", 1, points.iter().map(|point| point.rest_length_m));
    out += "</PointData>\n<CellData Scalars=\"cable\">\n";
    array(&mut out, "Int32", "cable", 1, (1..=shapes.len()).chain([0]));
    array(&mut out, "Float64", "rest_length_m", 1, lengths.chain([0.0]));
    out += "</CellData>\n<Points>\n";
    let coordinates = points.iter().flat_map(|point| point.position_m.iter().copied());
    array(&mut out, "Float64", "Points", 3, coordinates);
    out += "</Points>\n<Lines>\n";
    array(&mut out, "Int64", "connectivity", 1, 0..points.len());
    array(&mut out, "Int64", "offsets", 1, ends);
    out += "</Lines>\n<Polys>\n";
    array(&mut out, "Int64", "offsets", 1, [corners.len()]);
    array(&mut out, "Int64", "connectivity", 1, corners);
    out += "</Polys>\n</Piece>\n</PolyData>\n</VTKFile>\n";
    out
}

fn array(
    out: &mut String,
    kind: &str,
    name: &str,
    components: usize,
    values: impl IntoIterator<Item = impl Display>,
) {
    let _ = write!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">"
    );
    for (k, value) in values.into_iter().enumerate() {
        let _ = write!(out, "{}{value}", if k % 12 == 0 { '\n' } else { ' ' });
    }
    out.push_str("\n</DataArray>\n");
}

/// The cables (counted from 0) that go around the platform, seen along its z axis, one for each place where
/// cables are attached.
fn outline(request: &Request) -> Vec<usize> {
    let places = request.robot.robot.cables().each_ref().map(|cable| cable.attachment_m);
    let mut corners: Vec<usize> =
        (0..places.len()).filter(|&i| !places[..i].contains(&places[i])).collect();
    let sum = corners.iter().fold(Vector3::zeros(), |sum, &i| sum + places[i]);
    let middle = sum / corners.len() as f64;
    let angle = |i: usize| (places[i].y - middle.y).atan2(places[i].x - middle.x);
    corners.sort_by(|&a, &b| angle(a).total_cmp(&angle(b)));
    corners
}

#[cfg(test)]
mod tests {
    use cdpr_core::CABLES;

    use super::*;
    use crate::enumerate::{ModelKind, Options};
    use crate::robot_file::RobotDescription;

    fn solved() -> (Request, Shapes, [f64; CABLES]) {
        let request = Request {
            robot: RobotDescription::marionet_crane(),
            position_m: [4.0, 7.0, 2.0],
            rotation_vector_rad: [0.0, 0.1, 0.0],
            model: ModelKind::Irvine,
        };
        let found = request.enumerate(Options::default()).unwrap();
        let solution = &found.solutions[0].solution;
        let shapes = request.shapes(solution).unwrap();
        (request, shapes, solution.states.map(|state| state.rest_length_m))
    }

    fn ends(request: &Request) -> [[Vector3<f64>; 2]; CABLES] {
        let pose = request.pose().unwrap();
        request
            .robot
            .robot
            .cables()
            .each_ref()
            .map(|cable| [cable.anchor_m, pose.position_m() + pose.turn(&cable.attachment_m)])
    }

    #[test]
    fn vtp_has_a_line_from_each_anchor_to_its_attachment() {
        let (request, shapes, lengths) = solved();
        let text = vtp(&request, &shapes);
        let document = roxmltree::Document::parse(&text).unwrap();
        let find = |parent: roxmltree::Node<'_, '_>, tag: &str| {
            parent.descendants().find(|node| node.has_tag_name(tag)).unwrap().id()
        };
        let node = |tag: &str| document.get_node(find(document.root(), tag)).unwrap();
        let numbers = |parent: &str, name: &str| -> Vec<f64> {
            let array = node(parent)
                .children()
                .find(|array| array.attribute("Name") == Some(name))
                .unwrap();
            let text = array.text().unwrap().split_whitespace();
            text.map(|number| number.parse().unwrap()).collect()
        };
        let count =
            |name: &str| -> usize { node("Piece").attribute(name).unwrap().parse().unwrap() };
        let points = numbers("Points", "Points");
        let offsets = numbers("Lines", "offsets");
        assert_eq!(points.len(), 3 * count("NumberOfPoints"));
        assert_eq!((offsets.len(), count("NumberOfLines"), count("NumberOfPolys")), (6, 6, 1));
        let indices: Vec<f64> = (0..count("NumberOfPoints")).map(|k| k as f64).collect();
        assert_eq!(numbers("Lines", "connectivity"), indices);
        for name in ["tension_n", "s_m"] {
            assert_eq!(numbers("PointData", name).len(), count("NumberOfPoints"));
        }
        assert_eq!(numbers("CellData", "cable"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0]);
        assert_eq!(numbers("CellData", "rest_length_m"), [&lengths[..], &[0.0]].concat());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // written as counts
        let place =
            |k: f64| Vector3::from_column_slice(&points[3 * k as usize..3 * k as usize + 3]);
        let mut first = 0.0;
        for ([anchor_m, attachment_m], end) in ends(&request).iter().zip(&offsets) {
            assert_eq!(place(first), *anchor_m);
            assert!((place(end - 1.0) - attachment_m).norm() < 1e-9);
            first = *end;
        }
        // The platform: cables 1 and 2, 3 (with 4) and 5 (with 6), against the clock.
        let corners = numbers("Polys", "connectivity");
        assert_eq!(numbers("Polys", "offsets"), [4.0]);
        let places = ends(&request).map(|[_, attachment_m]| attachment_m);
        for (corner, cable) in corners.iter().zip([0, 1, 2, 4]) {
            assert!((place(*corner) - places[cable]).norm() < 1e-9);
        }
    }

    #[test]
    fn csv_has_a_row_for_each_point() {
        let (request, shapes, _) = solved();
        let bytes = csv(&shapes).unwrap();
        let mut table = csv::Reader::from_reader(&bytes[..]);
        let rows: Vec<[f64; 6]> = table.deserialize().map(Result::unwrap).collect();
        assert_eq!(
            table.headers().unwrap(),
            vec!["cable", "s_m", "x_m", "y_m", "z_m", "tension_n"]
        );
        assert_eq!(rows.len(), shapes.iter().map(Vec::len).sum::<usize>());
        for (number, [anchor_m, attachment_m]) in (1..).zip(ends(&request)) {
            let mut cable =
                rows.iter().filter(|row| row[0].to_bits() == f64::from(number).to_bits());
            let (first, last) = (cable.next().unwrap(), cable.next_back().unwrap());
            assert_eq!(first[1..5], [0.0, anchor_m.x, anchor_m.y, anchor_m.z]);
            assert!((Vector3::from_column_slice(&last[2..5]) - attachment_m).norm() < 1e-9);
        }
    }
}
