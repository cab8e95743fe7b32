//! The ideal page, row by row as it must be sent to a printer that is slightly off.

use rayon::prelude::*;

use super::block::Block;
use super::marks::Mark;
use super::rect::Rect;
use super::settings::Layout;
use observe::Observer;
use sheet::{Area, DotMap};

/// The ideal page.
pub(super) struct IdealPage<'a> {
    pub dots: &'a DotMap,
    pub layout: &'a Layout,
    pub block: &'a Block,
    pub marks: &'a [(Mark, u8)],
}

impl IdealPage<'_> {
    /// The dots of the sheet, row by row as they are sent.
    pub fn render(&self, observer: &dyn Observer) -> Vec<u8> {
        let width = usize::from(self.layout.paper.width()) * self.layout.across();
        let length = self.layout.paper.length();
        observer.begin("layout", length.into());
        let mut index = vec![0; width * usize::from(length)];
        index.par_chunks_exact_mut(width).enumerate().for_each(|(sent, row)| {
            self.row(self.layout.profile.lands_on(sent as i64), row);
            observer.advance(1);
        });
        observer.end();
        index
    }

    /// The row of the ideal page at `y`, as it must be sent.
    fn row(&self, y: i64, row: &mut [u8]) {
        if !(self.block.room.top..self.block.room.bottom).contains(&y) {
            return;
        }
        let (offset, across) = (self.layout.profile.offset().0, self.layout.across());
        let fits = |left: i64, right: i64| (left.max(self.block.room.left), right.min(self.block.room.right));
        if let Some(&(top, _)) = self.block.rows.iter().find(|(top, bottom)| (*top..*bottom).contains(&y)) {
            // Within the dot map, by the line above.
            let start = (y - top) as usize * self.dots.width();
            let dots = &self.dots.index()[start..start + self.dots.width()];
            for &(left, right) in &self.block.columns {
                let (from, to) = fits(left, right);
                if from >= to {
                    continue;
                }
                // The room lies within what the offset leaves of the row.
                let target = &mut row[across * (from - offset) as usize..across * (to - offset) as usize];
                if self.layout.mirror {
                    let source = &dots[across * (right - to) as usize..across * (right - from) as usize];
                    target.iter_mut().zip(source.iter().rev()).for_each(|(dot, &source)| *dot = source);
                } else {
                    target.copy_from_slice(
                        &dots[across * (from - left) as usize..across * (to - left) as usize],
                    );
                }
            }
        }
        for (mark, stack) in self.marks {
            if !(mark.place.top..mark.place.bottom).contains(&y) {
                continue;
            }
            let (from, to) = fits(mark.place.left, mark.place.right);
            for x in (from..to).filter(|&x| mark.covers(x, y)) {
                row[across * (x - offset) as usize..][..across].fill(*stack);
            }
        }
    }
}

/// A rectangle within the room, in dots of the sheet.
pub(super) fn area(layout: &Layout, place: Rect) -> Option<Area> {
    if place.width() <= 0 || place.length() <= 0 {
        return None;
    }
    let offset = layout.profile.offset().0;
    let sent = i64::from(layout.paper.length());
    // Rows land in order, so the first and the last are found by halving.
    let first_at = |y: i64| {
        let (mut low, mut high) = (0, sent);
        while low < high {
            let middle = (low + high) / 2;
            if layout.profile.lands_on(middle) < y { low = middle + 1 } else { high = middle }
        }
        low
    };
    let (top, bottom) = (first_at(place.top), first_at(place.bottom));
    (top < bottom).then(|| Area {
        left: layout.across() * (place.left - offset) as usize,
        top: top as usize,
        width: layout.across() * place.width() as usize,
        length: (bottom - top) as usize,
    })
}
