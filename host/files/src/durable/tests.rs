//! The steps, cut anywhere: by a fault that the program survives, on a real disk and on a model of one, and by the loss of the
//! supply, on the model.
//!
//! The model keeps what POSIX promises and nothing more. What was written but not synced is, after a crash, all there, half
//! there or not there, and the names in a folder are those of any moment since its last sync.

use super::*;
use std::collections::BTreeMap;

type Names = BTreeMap<String, usize>;

/// What is in a file or a folder: as programs see it and, first, as it was when it was last synced.
#[derive(Clone)]
enum Node {
    File { kept: Vec<u8>, now: Vec<u8> },
    Folder { moments: Vec<Names> },
}

/// A disk whose root is node 0.
#[derive(Clone)]
struct Model {
    nodes: Vec<Node>,
    exchanges: bool,
}

impl Model {
    fn new() -> Model {
        Model { nodes: vec![Node::Folder { moments: vec![Names::new()] }], exchanges: true }
    }

    fn add(&mut self, path: &str, node: Node) {
        self.nodes.push(node);
        let number = self.nodes.len() - 1;
        self.change(Path::new(path), |names, name| {
            names.insert(name, number);
        })
        .unwrap();
    }

    /// A file that is on disk.
    fn with(mut self, path: &str, contents: &[u8]) -> Model {
        self.add(path, Node::File { kept: contents.into(), now: contents.into() });
        self.sync(folder_of(Path::new(path))).unwrap();
        self
    }

    /// A folder, or a file, that nothing was done to keep.
    fn loose(mut self, path: &str, contents: Option<&[u8]>) -> Model {
        self.add(
            path,
            match contents {
                Some(contents) => Node::File { kept: Vec::new(), now: contents.into() },
                None => Node::Folder { moments: vec![Names::new()] },
            },
        );
        self
    }

    fn names(&self, folder: usize) -> io::Result<&Names> {
        match &self.nodes[folder] {
            Node::Folder { moments } => Ok(moments.last().unwrap()),
            Node::File { .. } => Err(io::ErrorKind::NotADirectory.into()),
        }
    }

    fn find(&self, path: &Path) -> io::Result<usize> {
        path.iter().filter(|name| *name != ".").try_fold(0, |at, name| {
            self.names(at)?.get(name.to_str().unwrap()).copied().ok_or_else(|| io::ErrorKind::NotFound.into())
        })
    }

    fn read(&self, path: &str) -> Option<&[u8]> {
        match &self.nodes[self.find(Path::new(path)).ok()?] {
            Node::File { now, .. } => Some(now),
            Node::Folder { .. } => None,
        }
    }

    fn change(&mut self, path: &Path, how: impl FnOnce(&mut Names, String)) -> io::Result<()> {
        let folder = self.find(folder_of(path))?;
        let mut names = self.names(folder)?.clone();
        how(&mut names, path.file_name().unwrap().to_str().unwrap().into());
        let Node::Folder { moments } = &mut self.nodes[folder] else { unreachable!() };
        moments.push(names);
        Ok(())
    }

    /// Every disk that may be found after the supply was lost now.
    fn crashed(&self) -> Vec<Model> {
        let mut found = vec![Model { nodes: Vec::new(), ..*self }];
        for node in &self.nodes {
            let left: Vec<Node> = match node {
                Node::Folder { moments } => {
                    moments.iter().map(|names| Node::Folder { moments: vec![names.clone()] }).collect()
                }
                Node::File { kept, now } if kept == now => vec![node.clone()],
                Node::File { kept, now } => [kept, &now[..now.len() / 2], now]
                    .map(|left: &[u8]| Node::File { kept: left.into(), now: left.into() })
                    .into(),
            };
            found = found
                .iter()
                .flat_map(|disk| {
                    left.iter().map(|node| Model {
                        nodes: [&disk.nodes[..], std::slice::from_ref(node)].concat(),
                        ..*self
                    })
                })
                .collect();
        }
        found
    }
}

impl Disk for Model {
    fn create(&mut self, folder: &Path, _: Access) -> io::Result<PathBuf> {
        let path = folder.join(format!("{STAGED}{}", self.nodes.len()));
        self.add(path.to_str().unwrap(), Node::File { kept: Vec::new(), now: Vec::new() });
        Ok(path)
    }

    fn fill(&mut self, file: &Path, contents: &[u8]) -> io::Result<()> {
        let number = self.find(file)?;
        let Node::File { now, .. } = &mut self.nodes[number] else { panic!("{file:?} is a folder") };
        *now = contents.into();
        Ok(())
    }

    fn inside(&mut self, path: &Path) -> io::Result<Vec<PathBuf>> {
        let names = self.names(self.find(path)?);
        Ok(names.map_or(Vec::new(), |names| names.keys().map(|name| path.join(name)).collect()))
    }

    fn sync(&mut self, path: &Path) -> io::Result<()> {
        let number = self.find(path)?;
        match &mut self.nodes[number] {
            Node::File { kept, now } => kept.clone_from(now),
            Node::Folder { moments } => drop(moments.drain(..moments.len() - 1)),
        }
        Ok(())
    }

    fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()> {
        let number = self.find(from)?;
        self.change(to, |names, name| {
            names.insert(name, number);
        })?;
        self.change(from, |names, name| {
            names.remove(&name);
        })
    }

    fn is_folder(&mut self, path: &Path) -> bool {
        self.find(path).is_ok_and(|number| matches!(self.nodes[number], Node::Folder { .. }))
    }

    fn exchange(&mut self, one: &Path, other: &Path) -> io::Result<()> {
        if !self.exchanges {
            return Err(io::ErrorKind::Unsupported.into());
        }
        let (a, b) = (self.find(one)?, self.find(other)?);
        self.change(one, |names, name| {
            names.insert(name, b);
        })?;
        self.change(other, |names, name| {
            names.insert(name, a);
        })
    }

    fn remove(&mut self, file: &Path) -> io::Result<()> {
        self.find(file)?;
        self.change(file, |names, name| {
            names.remove(&name);
        })
    }
}

/// A disk on which the step after so many fails, and those that follow, too, if nothing works any more.
struct Cut<D> {
    disk: D,
    steps: usize,
    for_ever: bool,
}

impl<D> Cut<D> {
    fn step(&mut self) -> io::Result<&mut D> {
        let left = self.steps;
        self.steps = if left > 0 {
            left - 1
        } else if self.for_ever {
            0
        } else {
            usize::MAX
        };
        if left == 0 { Err(io::Error::other("cut")) } else { Ok(&mut self.disk) }
    }
}

impl<D: Disk> Disk for Cut<D> {
    fn create(&mut self, folder: &Path, access: Access) -> io::Result<PathBuf> {
        self.step()?.create(folder, access)
    }

    fn fill(&mut self, file: &Path, contents: &[u8]) -> io::Result<()> {
        match self.step() {
            Ok(disk) => disk.fill(file, contents),
            // A full disk takes a part.
            Err(error) => self.disk.fill(file, &contents[..contents.len() / 2]).and(Err(error)),
        }
    }

    fn inside(&mut self, path: &Path) -> io::Result<Vec<PathBuf>> {
        self.step()?.inside(path)
    }

    fn sync(&mut self, path: &Path) -> io::Result<()> {
        self.step()?.sync(path)
    }

    fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()> {
        self.step()?.rename(from, to)
    }

    fn is_folder(&mut self, path: &Path) -> bool {
        self.disk.is_folder(path)
    }

    fn exchange(&mut self, one: &Path, other: &Path) -> io::Result<()> {
        self.step()?.exchange(one, other)
    }

    fn remove(&mut self, file: &Path) -> io::Result<()> {
        self.step()?.remove(file)
    }
}

const NAME: &str = "job.json";
const OLD: &[u8] = b"the old contents";
const NEW: &[u8] = b"and the new ones, which are longer";

/// More steps than a file takes.
const STEPS: usize = 12;

#[test]
fn after_any_step_a_crash_leaves_the_old_contents_or_the_new_and_in_the_end_only_the_new() {
    for old in [None, Some(OLD)] {
        let mut finished = 0;
        for steps in 0..STEPS {
            let disk = Model::new();
            let disk = old.map_or(disk.clone(), |old| disk.with(NAME, old));
            let mut disk = Cut { disk, steps, for_ever: true };
            let done = write_on(&mut disk, Path::new(NAME), NEW, Access::Private).is_ok();
            finished += usize::from(done);
            for found in disk.disk.crashed() {
                let read = found.read(NAME);
                assert!(read == Some(NEW) || (!done && read == old), "{steps} steps: {read:?}");
                let hidden = |name: &String| name == NAME || name.starts_with(STAGED);
                assert!(found.names(0).unwrap().keys().all(hidden));
            }
        }
        assert!((1..STEPS).contains(&finished));
    }
}

/// A staged folder with a file, and another inside, and perhaps one of its name that is on disk.
fn staged(replaces: bool, exchanges: bool) -> Model {
    let mut disk = Model { exchanges, ..Model::new() }
        .loose("staging", None)
        .loose("staging/job", None)
        .loose("staging/job/data", Some(NEW))
        .loose("staging/job/inner", None)
        .loose("staging/job/inner/page", Some(NEW));
    if replaces {
        disk = disk.loose("job", None).with("job/data", OLD);
    }
    disk.sync(Path::new(".")).unwrap();
    disk
}

#[test]
fn a_folder_is_there_with_all_that_is_in_it_or_the_old_one_is() {
    for (replaces, exchanges) in [(false, true), (true, true), (true, false)] {
        let mut finished = 0;
        for steps in 0..2 * STEPS {
            let mut disk = Cut { disk: staged(replaces, exchanges), steps, for_ever: true };
            let done = place_on(&mut disk, Path::new("staging/job"), Path::new("job")).is_ok();
            finished += usize::from(done);
            for found in disk.disk.crashed() {
                let read = [found.read("job/data"), found.read("job/inner/page")];
                let old = match replaces {
                    // Where folders cannot change places, the old one may have been put aside.
                    true if exchanges || found.find(Path::new("job")).is_ok() => [Some(OLD), None],
                    _ => [None, None],
                };
                assert!(read == [Some(NEW); 2] || (!done && read == old), "{steps} steps: {read:?}");
            }
        }
        assert!((1..2 * STEPS).contains(&finished));
    }
}

#[test]
fn a_fault_while_a_folder_is_replaced_leaves_one_of_the_two() {
    for exchanges in [true, false] {
        for steps in 0..2 * STEPS {
            let mut disk = Cut { disk: staged(true, exchanges), steps, for_ever: false };
            let fault = place_on(&mut disk, Path::new("staging/job"), Path::new("job")).is_err();
            let read = disk.disk.read("job/data");
            assert!(read == Some(NEW) || (fault && read == Some(OLD)), "{steps} steps: {read:?}");
        }
    }
}

#[test]
fn folders_on_a_real_disk_change_places() {
    let folder = tempfile::tempdir().unwrap();
    let [from, to] = ["new", "job"].map(|name| folder.path().join(name));
    for (path, contents) in [(&from, NEW), (&to, OLD)] {
        fs::create_dir(path).unwrap();
        fs::write(path.join("data"), contents).unwrap();
    }
    place(&from, &to).unwrap();
    assert_eq!(fs::read(to.join("data")).unwrap(), NEW);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "the old one is left to the caller");
}

#[test]
fn the_model_finds_what_careless_writers_lose() {
    let name = Path::new(NAME);
    let lost = |how: &dyn Fn(&mut Model, &Path) -> io::Result<()>| {
        let mut disk = Model::new().with(NAME, OLD);
        let staged = disk.create(Path::new("."), Access::Private).unwrap();
        how(&mut disk, &staged).unwrap();
        disk.crashed().iter().any(|found| found.read(NAME) != Some(NEW))
    };
    assert!(lost(&|disk, _| disk.fill(name, NEW)), "written in place");
    assert!(
        lost(&|disk, staged| {
            disk.fill(staged, NEW)?;
            disk.rename(staged, name)?;
            disk.sync(Path::new("."))
        }),
        "the file is not synced"
    );
    assert!(
        lost(&|disk, staged| {
            disk.fill(staged, NEW)?;
            disk.sync(staged)?;
            disk.rename(staged, name)
        }),
        "the folder is not synced"
    );
}

#[test]
fn a_fault_at_any_step_leaves_one_whole_file_and_nothing_beside_it() {
    let mut faults = 0;
    for steps in 0..STEPS {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        write(&path, OLD, Access::Private).unwrap();
        let mut disk = Cut { disk: System, steps, for_ever: false };
        let fault = write_on(&mut disk, &path, NEW, Access::Private).is_err();
        faults += usize::from(fault);
        let read = fs::read(&path).unwrap();
        assert!(read == NEW || (fault && read == OLD), "{steps} steps: {read:?}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "{steps} steps");
    }
    assert!((1..STEPS).contains(&faults));
}

#[test]
#[cfg(unix)]
fn who_may_read_a_file_does_not_depend_on_what_was_there() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a/b/file");
    make_folder(path.parent().unwrap(), Access::Private).unwrap();
    make_folder(path.parent().unwrap(), Access::Everyone).unwrap();
    for made in ["a", "a/b"] {
        assert_eq!(fs::metadata(folder.path().join(made)).unwrap().permissions().mode() & 0o7777, 0o700);
    }
    for access in [Access::Everyone, Access::Private, Access::Program, Access::Everyone] {
        write(&path, NEW, access).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o7777, access.mode());
    }
    let link = folder.path().join("link");
    std::os::unix::fs::symlink(&path, &link).unwrap();
    write(&link, OLD, Access::Private).unwrap();
    assert_eq!((fs::read(&link).unwrap(), fs::read(&path).unwrap()), (OLD.to_vec(), NEW.to_vec()));
    assert!(write(&folder.path().join("missing/file"), NEW, Access::Private).is_err());
}
