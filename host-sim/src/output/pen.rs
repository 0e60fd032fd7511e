//! Drawing at places given in pixels, for the pictures of this project.

use std::io;

use nalgebra::Vector2;
use plotters::coord::Shift;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// The back end draws at whole numbers; this many of them make a pixel.
pub const FINE: u32 = 20;
/// The back end divides the size of every font by this.
const FONT_DIVISOR: f64 = 1.24;

/// Lines and text.
pub const INK: RGBColor = RGBColor(35, 40, 50);
/// What explains the rest.
pub const GREY: RGBColor = RGBColor(110, 116, 128);
/// Grids.
pub const PALE: RGBColor = RGBColor(214, 217, 223);

/// Why something could not be drawn.
pub type PenFault = DrawingAreaErrorKind<io::Error>;

/// Draws on an SVG.
pub struct Pen<'a> {
    /// The whole picture, in the whole numbers of the back end.
    pub area: DrawingArea<SVGBackend<'a>, Shift>,
}

impl Pen<'_> {
    /// The SVG text of a white picture of `size_px` (width, height) on which `paint` has drawn.
    ///
    /// # Errors
    /// What `paint` returns.
    pub fn picture<E: From<PenFault>>(
        (width, height): (u32, u32),
        paint: impl FnOnce(&Pen<'_>) -> Result<(), E>,
    ) -> Result<String, E> {
        let mut svg = String::new();
        let fine = (width * FINE, height * FINE);
        {
            let pen = Pen { area: SVGBackend::with_string(&mut svg, fine).into_drawing_area() };
            pen.area.fill(&WHITE)?;
            paint(&pen)?;
            pen.area.present()?;
        }
        let drawn = format!(r#"width="{}" height="{}""#, fine.0, fine.1);
        Ok(svg.replacen(&drawn, &format!(r#"width="{width}" height="{height}""#), 1))
    }

    /// A line through the places of `path`.
    ///
    /// # Errors
    /// [`PenFault`], which an SVG in memory never meets; so for the rest of them.
    pub fn line(&self, path: &[Vector2<f64>], color: RGBColor, width: f64) -> Result<(), PenFault> {
        let path: Vec<_> = path.iter().map(whole).collect();
        self.area.draw(&PathElement::new(path, color.stroke_width(fine(width))))
    }

    /// The same with dashes and gaps of `dash` px.
    ///
    /// # Errors
    /// As [`Pen::line`].
    pub fn dashed(
        &self,
        path: &[Vector2<f64>],
        color: RGBColor,
        width: f64,
        dash: f64,
    ) -> Result<(), PenFault> {
        let style = color.stroke_width(fine(width));
        let path: Vec<_> = path.iter().map(whole).collect();
        self.area.draw(&DashedPathElement::new(path, fine(dash), fine(dash), style))
    }

    /// An arrow.
    ///
    /// # Errors
    /// As [`Pen::line`].
    pub fn arrow(
        &self,
        from: Vector2<f64>,
        to: Vector2<f64>,
        color: RGBColor,
        width: f64,
    ) -> Result<(), PenFault> {
        let along = (to - from).normalize() * (5.0 + 2.0 * width);
        let across = Vector2::new(along.y, -along.x) * 0.36;
        self.line(&[from, to - along * 0.5], color, width)?;
        self.fill(&[to, to - along + across, to - along - across], color)
    }

    /// A filled polygon.
    ///
    /// # Errors
    /// As [`Pen::line`].
    pub fn fill(&self, corners: &[Vector2<f64>], color: RGBColor) -> Result<(), PenFault> {
        let corners: Vec<_> = corners.iter().map(whole).collect();
        self.area.draw(&Polygon::new(corners, color))
    }

    /// A filled circle.
    ///
    /// # Errors
    /// As [`Pen::line`].
    pub fn dot(&self, center: Vector2<f64>, radius: f64, color: RGBColor) -> Result<(), PenFault> {
        self.area.draw(&Circle::new(whole(&center), fine(radius), color.filled()))
    }

    /// Text whose middle is as high as the place.
    ///
    /// # Errors
    /// As [`Pen::line`].
    pub fn text(
        &self,
        place: Vector2<f64>,
        text: &str,
        side: HPos,
        color: RGBColor,
    ) -> Result<(), PenFault> {
        let style = font(16.0, color).pos(Pos::new(side, VPos::Center));
        self.area.draw(&Text::new(text.to_owned(), whole(&place), style))
    }

    /// A heading at the top, `left` px from the edge.
    ///
    /// # Errors
    /// As [`Pen::line`].
    pub fn heading(&self, left: f64, text: &str) -> Result<(), PenFault> {
        let style = font(19.0, INK);
        let style = TextStyle { font: style.font.style(FontStyle::Bold), ..style };
        self.area.draw(&Text::new(text.to_owned(), whole(&px(left, 16.0)), style))
    }

    /// A note under the heading.
    ///
    /// # Errors
    /// As [`Pen::line`].
    pub fn note(&self, left: f64, text: &str) -> Result<(), PenFault> {
        self.text(px(left, 50.0), text, HPos::Left, GREY)
    }
}

/// A place in the picture from its upper left corner, or a step from one to another.
#[must_use]
pub fn px(right: f64, down: f64) -> Vector2<f64> {
    Vector2::new(right, down)
}

/// The font of all pictures.
#[must_use]
pub fn font(size_px: f64, color: RGBColor) -> TextStyle<'static> {
    let font = ("sans-serif", f64::from(FINE) * size_px * FONT_DIVISOR).into_font();
    TextStyle { color: color.to_backend_color(), ..TextStyle::from(font) }
}

/// A size in the whole numbers of the back end.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // all sizes are small
#[must_use]
pub fn fine(px: f64) -> u32 {
    (px * f64::from(FINE)).round() as u32
}

/// A place in the whole numbers of the back end.
#[allow(clippy::cast_possible_truncation)] // all places are on the picture or near
fn whole(place: &Vector2<f64>) -> (i32, i32) {
    let fine = place * f64::from(FINE);
    (fine.x.round() as i32, fine.y.round() as i32)
}
