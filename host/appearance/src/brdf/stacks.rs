//! Stacks of the ink library as rows of a space.

use inks::{Entry, Library, Stack};

use super::space::{Space, Table};

/// One row per entry, reflectance in 1/sr. Only for half-angle spaces, like [`Space::row`]. Modelled stacks are evaluated
/// at the angles of the space, so no narrow peak is interpolated.
pub(crate) fn rows<'a>(space: &Space, entries: impl IntoIterator<Item = &'a Entry>) -> Table {
    let mut table = Table::new(space.columns());
    for entry in entries {
        table.push(&space.row(&entry.curve_at(space.angles())));
    }
    table
}

/// What stacks reflect (1/sr), one row a stack, as the library lists them or its model says. Only for half-angle spaces.
///
/// A stack the library does not know shows as its longest part from the top that it does know: the uppermost
/// layers decide most of what is seen.
pub fn reflectances(stacks: &[Stack], library: &Library, space: &Space) -> Table {
    let mut table = Table::new(space.columns());
    for stack in stacks {
        let layers = stack.layers();
        let known = (0..=layers.len())
            .find_map(|below| library.curve_of(&Stack::new(&layers[below..]), space.angles()));
        table.push(&known.map_or_else(|| vec![0.0; space.columns()], |curve| space.row(&curve)));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use inks::Library;

    /// The curve in a library is tabulated; the error of interpolating it must be invisible.
    #[test]
    fn a_tabulated_stack_is_the_modelled_one() {
        let library = Library::builtin();
        for samples in [32, 96, 500] {
            let space = Space::half_angle(samples);
            let exact = rows(&space, library.entries());
            assert_eq!(exact.len(), 57);
            for (entry, row) in library.entries().iter().zip(exact.rows()) {
                let d = space.distance(row, &space.row(&entry.curve));
                // A twentieth of a barely visible difference. The rest comes from the last third of a degree.
                assert!(d < 5e-4, "{}: {d}", entry.stack);
            }
        }
    }

    /// Published with the model: the distance between white paper and black is about 0.68 in this metric.
    #[test]
    fn plain_paper_has_its_published_size() {
        let space = Space::half_angle(64);
        let paper = rows(&space, &Library::builtin().entries()[..1]);
        let size = space.distance(paper.row(0), &vec![0.0; space.columns()]);
        assert!((size - 0.68).abs() < 0.01, "{size}");
    }
}
