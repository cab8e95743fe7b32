//! A page on disk: the sheet's files, and where things are on it in `layout.toml`.

use std::path::Path;

use super::{Arranged, Laid};
use files::shelf::{Disk, Shelf as _};
use files::{FileError, read_toml, write_toml};
use sheet::{Area, Sheet};

/// The text beside the sheet's.
const TEXT: &str = "layout.toml";

impl Arranged {
    /// Writes the page into a folder that exists.
    ///
    /// # Errors
    /// What the system refuses.
    pub fn save(&self, folder: &Path) -> Result<(), FileError> {
        write_toml(&folder.join(TEXT), &self.laid)?;
        self.sheet.save(folder)
    }

    /// Reads what [`Arranged::save`] wrote, or a sheet by itself: all of it then is one copy.
    ///
    /// # Errors
    /// Files that cannot be read, or are not what was written, with the field.
    pub fn load(folder: &Path) -> Result<Arranged, FileError> {
        let sheet = Sheet::load(folder)?;
        let path = folder.join(TEXT);
        if !Disk.is_file(&path) {
            let laid = Laid::single(Area::whole(sheet.dots()));
            return Ok(Arranged { sheet, laid });
        }
        let laid: Laid = read_toml(&path)?;
        let wrong = |problem: &str| FileError::Text { path: path.clone(), problem: problem.into() };
        let (width, length) = (sheet.width(), sheet.length());
        if !laid.area.fits(width, length) {
            return Err(wrong("area: empty, or not on the sheet"));
        }
        if laid.copies.is_empty() || !laid.copies.iter().all(|copy| copy.fits(width, length)) {
            return Err(wrong("copies: none, empty, or not on the sheet"));
        }
        Ok(Arranged { sheet, laid })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{Layout, Mm, Point, Repeat, arrange};
    use inks::Stack;
    use observe::Silent;
    use protocol::ink::Ink;
    use protocol::paper::Paper;
    use sheet::DotMap;

    #[test]
    fn a_page_comes_back_with_its_copies_and_nonsense_is_refused() {
        let stacks = vec![Stack::SUBSTRATE, Stack::new([Ink::Cyan])];
        let dots = DotMap::new(30, 20, stacks, vec![1; 600]).unwrap();
        let layout = Layout {
            repeat: Repeat::Grid(3, 2),
            gap: Point(Mm(3.0), Mm(3.0)),
            crop_marks: true,
            ..Layout::centred(Paper::Custom { width: 500, length: 400 })
        };
        let page = arrange(&dots, &layout, &Silent).unwrap();
        assert_eq!(page.laid.copies.len(), 6);
        let folder = tempfile::tempdir().unwrap();
        page.save(folder.path()).unwrap();
        assert_eq!(Arranged::load(folder.path()).unwrap(), page);
        let path = folder.path().join(TEXT);
        let good = std::fs::read_to_string(&path).unwrap();
        for (from, to, words) in [
            ("width = 30", "width = 3000", "copies"),
            ("length = 20", "length = 0", "copies"),
            ("grid", "gird", "gird"),
        ] {
            assert!(good.contains(from), "{good}");
            std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
            let said = Arranged::load(folder.path()).unwrap_err().to_string();
            assert!(said.contains(words) && said.contains(TEXT), "{said}");
        }
        // A sheet by itself is one copy.
        std::fs::remove_file(&path).unwrap();
        let alone = Arranged::load(folder.path()).unwrap();
        assert_eq!(alone.laid.copies, [Area::whole(page.sheet.dots())]);
        assert_eq!(alone.sheet, page.sheet);
    }
}
