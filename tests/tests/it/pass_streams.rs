//! Pass streams against the printer's own packing: planes as they are halftoned and as people draw them, wherever they lie.

use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::ascii::FONT_10X20;
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::prelude::*;
use embedded_graphics::text::Text;
use halftone::Method;
use protocol::packbits;
use protocol::paper::Paper;
use protocol::runs::{MAX_BAND, encode, stride};
use protocol::walk::Placed;
use std::convert::Infallible;

use foilpress_tests::planes;

struct Plane {
    width: u16,
    rows: u16,
    bits: Vec<u8>,
}

impl Plane {
    fn drawn(draw: impl FnOnce(&mut Plane) -> Result<(), Infallible>) -> Plane {
        let mut plane = Plane { width: 4800, rows: 1600, bits: vec![0; 600 * 1600] };
        let Ok(()) = draw(&mut plane);
        assert!(plane.bits.iter().any(|&byte| byte != 0));
        plane
    }

    fn filled(inside: impl Fn(f64, f64) -> bool) -> Plane {
        Plane::drawn(|plane| {
            let dots = (0..1600).flat_map(|y| (0..4800).map(move |x| Point::new(x, y)));
            plane.draw_iter(
                dots.filter(|dot| inside(f64::from(dot.x), f64::from(dot.y)))
                    .map(|dot| Pixel(dot, BinaryColor::On)),
            )
        })
    }

    /// Bytes of the rows' data in the printer's language, without the commands around them.
    fn packed(&self) -> usize {
        let mut out = vec![0; stride(self.width)];
        let rows = self.bits.chunks_exact(stride(self.width));
        rows.map(|row| {
            let end = row.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
            packbits::pack_into(&row[..end], &mut out[..end]).unwrap_or(end)
        })
        .sum()
    }

    fn stream(&self) -> usize {
        let mut length = 0;
        let mut buffer = vec![0; MAX_BAND];
        encode(&Placed::whole(self.width, self.rows), &self.bits, &mut buffer, |band| length += band.len())
            .unwrap();
        length
    }
}

impl OriginDimensions for Plane {
    fn size(&self) -> Size {
        Size::new(u32::from(self.width), u32::from(self.rows))
    }
}

impl DrawTarget for Plane {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            let inside =
                (0..i32::from(self.width)).contains(&at.x) && (0..i32::from(self.rows)).contains(&at.y);
            if inside && colour == BinaryColor::On {
                self.bits[at.y as usize * stride(self.width) + at.x as usize / 8] |= 0x80 >> (at.x % 8);
            }
        }
        Ok(())
    }
}

/// Letters of twenty dots' height, each dot blown up to a square.
struct Enlarged<'p>(&'p mut Plane, i32);

impl OriginDimensions for Enlarged<'_> {
    fn size(&self) -> Size {
        self.0.size()
    }
}

impl DrawTarget for Enlarged<'_> {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        let side = self.1;
        for Pixel(at, colour) in pixels.into_iter().filter(|pixel| pixel.1 == BinaryColor::On) {
            let dots = (0..side).flat_map(|y| (0..side).map(move |x| at * side + Point::new(x, y)));
            self.0.draw_iter(dots.map(|dot| Pixel(dot, colour)))?;
        }
        Ok(())
    }
}

fn text(side: i32) -> Plane {
    Plane::drawn(|plane| {
        let mut page = Enlarged(plane, side);
        let style = MonoTextStyle::new(&FONT_10X20, BinaryColor::On);
        let line = "Foil goes last, over cyan, magenta, yellow and black. ".repeat(9);
        for y in 0..1600 / (22 * side) {
            Text::new(&line[y as usize..], Point::new(10, 20 + 22 * y), style).draw(&mut page)?;
        }
        Ok(())
    })
}

/// Everything within `half` dots of a level line every 40 rows, of slanted lines, of circles.
fn line_art(half: f64) -> Plane {
    Plane::filled(|x, y| {
        let level = (y % 40.0).min(40.0 - y % 40.0);
        let slanted = (0..20).map(|i| (x - 250.0 * f64::from(i) - y * 0.13 * f64::from(i - 9)).abs());
        let round = (0..20).map(|i| ((x - 2400.0).hypot(y - 800.0) - 70.0 * f64::from(i)).abs());
        slanted.chain(round).fold(level, f64::min) < half
    })
}

fn solids() -> Plane {
    Plane::filled(|x, y| {
        let rectangle = (100.0..1600.0).contains(&x) && (100.0..1300.0).contains(&y);
        let disc = (x - 2400.0).hypot(y - 800.0) < 650.0;
        let triangle = y < 1500.0 && (x - 4000.0).abs() < (y - 50.0) / 2.0;
        rectangle || disc || triangle
    })
}

#[test]
fn drawn_planes_are_never_larger_than_packed_rows() {
    let full = Plane { width: 4800, rows: 1600, bits: vec![0xff; 600 * 1600] };
    let dot = Plane::drawn(|plane| plane.draw_iter([Pixel(Point::new(2000, 900), BinaryColor::On)]));
    let planes = [
        ("type of 10 points", text(4)),
        ("type of 24 points", text(10)),
        ("hair lines", line_art(0.5)),
        ("lines of 6 dots", line_art(3.0)),
        ("lines of 25 dots", line_art(12.5)),
        ("solids", solids()),
        ("full", full),
        ("one dot", dot),
    ];
    for (name, plane) in planes {
        let (packed, stream) = (plane.packed(), plane.stream());
        println!("{name}: packed rows {packed}, stream {stream}, {:.2}", stream as f64 / packed as f64);
        // What the printer is sent beside the data: six bytes for each row, and six to say how they are packed.
        let rows = plane.bits.chunks_exact(600).filter(|row| row.iter().any(|&byte| byte != 0)).count();
        assert!(stream <= packed + 6 * rows + 6, "{name}: {stream} for {packed} in {rows} rows");
        assert!(stream <= packed || name == "one dot", "{name}: not even without the commands");
    }
}

#[test]
fn eight_clustered_planes_are_a_quarter_of_their_packed_rows_at_most() {
    let paper = Paper::Custom { width: 2400, length: 1280 };
    let (mut packed, mut streams) = (0, 0);
    for bits in planes::clustered((300, 160), (90.0, 70.0), paper) {
        let plane = Plane { width: 2400, rows: 1280, bits };
        packed += plane.packed();
        streams += plane.stream();
    }
    println!("packed rows {packed}, streams {streams}, 1/{:.2}", packed as f64 / streams as f64);
    assert!(4 * streams <= packed, "{streams} for {packed}");
}

/// A plane of 4800 by 3000 dots with copies of a picture at these corners.
fn placed(picture: &[u8], (width, height): (usize, usize), corners: &[(usize, usize)]) -> Plane {
    let mut plane = Plane { width: 4800, rows: 3000, bits: vec![0; 600 * 3000] };
    for &(left, top) in corners {
        for y in 0..height {
            for x in 0..width {
                if picture[y * width / 8 + x / 8] >> (7 - x % 8) & 1 == 1 {
                    let x = left + x;
                    plane.bits[(top + y) * 600 + x / 8] |= 0x80 >> (x % 8);
                }
            }
        }
    }
    plane
}

#[test]
fn cells_take_no_more_than_clusters_wherever_they_lie() {
    let paper = Paper::Custom { width: 2400, length: 1280 };
    let made = |method| planes::halftoned(method, (300, 160), (90.0, 70.0), paper);
    let size = |pictures: &[Vec<u8>], corners: &[(usize, usize)]| -> usize {
        pictures.iter().map(|bits| placed(bits, (2400, 1280), corners).stream()).sum()
    };
    let packed = |pictures: &[Vec<u8>], corners: &[(usize, usize)]| -> usize {
        pictures.iter().map(|bits| placed(bits, (2400, 1280), corners).packed()).sum()
    };
    let (walk, cells) = (made(Method::Walk), made(Method::Cells));
    let best = size(&walk, &[(0, 0)]);
    let places: [(&str, &[(usize, usize)]); 4] = [
        ("at the corner", &[(0, 0)]),
        ("beside it", &[(1237, 811)]),
        ("two copies and a gap", &[(0, 83), (2399 - 40, 83)]),
        ("two copies, one above the other", &[(605, 3), (605, 1400)]),
    ];
    for (name, corners) in places {
        let (rows, stream) = (packed(&cells, corners), size(&cells, corners));
        let clusters = size(&walk, corners);
        println!(
            "{name}: packed rows {rows}, cells {stream}, 1/{:.1}; clusters {clusters}, 1/{:.1}",
            rows as f64 / stream as f64,
            packed(&walk, corners) as f64 / clusters as f64
        );
        assert!(stream <= corners.len() * best, "{name}: {stream} bytes, clusters at the corner {best}");
    }
}
