use super::*;
use proptest::prelude::*;

/// Everything that a shelf says about the paths below its root, and about `root` itself.
fn said(shelf: &dyn Shelf, root: &Path, paths: &[PathBuf]) -> Vec<String> {
    let kind = |error: io::Error| error.kind();
    let about = |path: &PathBuf| {
        let path = root.join(path);
        let opened = shelf.open(&path).map(|opened| opened.size()).map_err(kind);
        let start = shelf.start(&path, 3).map_err(kind);
        let read = shelf.read(&path, 4).map_err(|error| match error {
            FileError::Io { source, .. } => format!("{:?}", source.kind()),
            // Its path is another one on each shelf.
            FileError::Large { found, most, .. } => format!("{found} over {most}"),
            error => error.to_string(),
        });
        format!(
            "{:?} {:?} {opened:?} {start:?} {read:?}",
            shelf.kind(&path).map_err(kind),
            shelf.list(&path).map_err(kind)
        )
    };
    paths.iter().map(about).collect()
}

proptest! {
    #[test]
    fn the_same_tree_on_disk_and_in_memory_says_the_same(
        tree in prop::collection::vec(("([abc]/){0,3}[abc]\\.?[xy]?", prop::collection::vec(any::<u8>(), 0..7)), 1..12),
        asked in prop::collection::vec("(\\./)?([abc]/){0,3}[abc]\\.?[xy]?", 1..12),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let mut memory = Memory::default();
        let mut paths = vec![PathBuf::new()];
        for (name, bytes) in tree {
            let at = folder.path().join(&name);
            let parent = at.parent().unwrap();
            let fits = !at.is_dir() && fs::create_dir_all(parent).is_ok();
            prop_assert_eq!(memory.insert(&name, bytes.clone()).is_ok(), fits, "{}", name);
            if fits {
                fs::write(&at, bytes).unwrap();
                paths.extend(Path::new(&name).ancestors().map(Path::to_path_buf));
            }
        }
        paths.extend(asked.into_iter().map(PathBuf::from));
        // What stands there is told from what does not, else two shelves that say nothing would agree.
        prop_assert!(said(&Disk, folder.path(), &paths).iter().any(|line| line.starts_with("Ok(File)")));
        prop_assert_eq!(said(&Disk, folder.path(), &paths), said(&memory, Path::new(""), &paths));
    }

    #[test]
    fn a_name_inside_a_document_stays_below_its_folder(name in "(\\.\\.|\\.|/|\\\\|:|C:|a|b c){0,8}") {
        if let Some(path) = inside(Path::new("base"), &name) {
            // By hand: a walk along the parts that never leaves the folder.
            let mut depth = 0i32;
            for part in path.to_str().unwrap().strip_prefix("base/").unwrap().split('/') {
                depth += match part { "" | "." => 0, ".." => -1, _ => 1 };
                prop_assert!(depth >= 0);
            }
        }
    }
}

#[test]
fn names_that_lead_out_are_refused_and_others_are_not() {
    let base = Path::new("tile");
    for name in
        ["", "..", "../a.png", "a/../../b", "/etc/passwd", "C:/a", "c:a", "a\\b", "\\\\host\\a", "a\0b"]
    {
        assert_eq!(inside(base, name), None, "{name}");
    }
    for name in ["a.png", "maps/a.png", "./a.png", "base colour.png", "..a", "a..png"] {
        assert_eq!(inside(base, name), Some(base.join(name)), "{name}");
    }
}

#[test]
fn files_in_memory_have_nothing_above_them() {
    let mut memory = Memory::default();
    memory.insert("a/b", *b"one").unwrap();
    for path in ["..", "a/../a/b", "a/.."] {
        assert_eq!(memory.kind(Path::new(path)).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        assert!(memory.open(Path::new(path)).is_err() && memory.insert(path, *b"").is_err(), "{path}");
    }
    // A name that begins like a folder's is not in it.
    memory.insert("a.b/c", *b"two").unwrap();
    memory.insert("ab", *b"three").unwrap();
    assert_eq!(memory.list(Path::new("a")).unwrap(), [("b".to_owned(), Kind::File)]);
}

#[test]
fn a_file_longer_than_its_limit_is_refused_with_both_sizes() {
    let mut memory = Memory::default();
    memory.insert("a", [7; 10]).unwrap();
    assert_eq!(memory.read(Path::new("a"), 10).unwrap(), [7; 10]);
    let error = memory.read(Path::new("a"), 9).unwrap_err().to_string();
    assert_eq!(error, "a: size in bytes is 10; the limit is 9");
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_and_links_to_them_are_never_opened() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let link = |to: &str, name: &str| std::os::unix::fs::symlink(to, at(name)).unwrap();
    link("/dev/zero", "device");
    link("nowhere", "nothing");
    fs::write(at("file"), "text").unwrap();
    link("file", "link");
    let _socket = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
    for name in ["device", "socket"] {
        assert_eq!(Disk.kind(&at(name)).unwrap(), Kind::Other);
        assert_eq!(Disk.open(&at(name)).err().unwrap().kind(), io::ErrorKind::InvalidInput);
    }
    assert_eq!(Disk.open(&at("nothing")).err().unwrap().kind(), io::ErrorKind::NotFound);
    assert_eq!(Disk.read(&at("link"), 9).unwrap(), b"text");
    let kinds: Vec<Kind> = Disk.list(folder.path()).unwrap().into_iter().map(|(_, kind)| kind).collect();
    assert_eq!(kinds, [Kind::Other, Kind::File, Kind::File, Kind::Other, Kind::Other]);
}

/// A file of the system that states no length is still read no further than its limit.
#[cfg(target_os = "linux")]
#[test]
fn a_file_without_a_length_is_bounded_too() {
    let path = Path::new("/proc/cpuinfo");
    assert_eq!(Disk.open(path).unwrap().size(), 0);
    assert!(matches!(Disk.read(path, 9), Err(FileError::Large { found: 10, most: 9, .. })));
}
