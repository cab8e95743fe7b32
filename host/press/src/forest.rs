//! Sets of numbers that are joined one after the other: union-find.
//!
//! Problem: what touches belongs together, but that is found pair by pair.
//! Method: every number knows an older one of its set; the oldest is the root and stands for all. Paths are halved
//! whenever they are followed (Tarjan and van Leeuwen 1984).
//! Cost: a few nanoseconds a step, paths hardly longer than one. Memory: 4 bytes a number.

/// Numbers from 0 on, and the sets they are in.
#[derive(Default)]
pub(crate) struct Forest {
    parent: Vec<u32>,
}

impl Forest {
    /// So many numbers, each by itself.
    pub(crate) fn new(count: usize) -> Forest {
        Forest { parent: (0..count as u32).collect() }
    }

    /// Adds the next number, by itself.
    pub(crate) fn add(&mut self) -> u32 {
        let number = self.parent.len() as u32;
        self.parent.push(number);
        number
    }

    /// The root of a number's set, its lowest number.
    pub(crate) fn root(&mut self, mut at: u32) -> u32 {
        while self.parent[at as usize] != at {
            let up = self.parent[self.parent[at as usize] as usize];
            self.parent[at as usize] = up;
            at = up;
        }
        at
    }

    /// Makes one set of those of two numbers. Returns the roots of both before if they were two, the one that stays first.
    pub(crate) fn join(&mut self, a: u32, b: u32) -> Option<(u32, u32)> {
        let (a, b) = (self.root(a), self.root(b));
        let (stays, goes) = (a.min(b), a.max(b));
        self.parent[goes as usize] = stays;
        (stays < goes).then_some((stays, goes))
    }

    /// The root of each number.
    pub(crate) fn roots(mut self) -> Vec<u32> {
        // Roots come before what belongs to them.
        for at in 0..self.parent.len() {
            self.parent[at] = self.parent[self.parent[at] as usize];
        }
        self.parent
    }
}
