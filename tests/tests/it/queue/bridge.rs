//! The bridge that the queue prints on: the one of [`served`], where the print system finds it.

use foilpress_tests::served::{self, Port};
use protocol::ink::Ink;
use std::net::SocketAddr;
use std::ops::Deref;

pub struct Bridge {
    pub address: SocketAddr,
    served: served::Bridge,
}

const INKS: [Ink; 4] = [Ink::Black, Ink::Cyan, Ink::Magenta, Ink::Yellow];

impl Bridge {
    /// A bridge at a free place.
    pub fn start(rate: usize) -> Bridge {
        Bridge::at("127.0.0.1:0".parse().unwrap(), rate)
    }

    pub fn at(address: SocketAddr, rate: usize) -> Bridge {
        Bridge::with(address, Port::new(&INKS, rate))
    }

    /// A board whose diary says that its supply went in the middle of this job.
    pub fn torn(address: SocketAddr, rate: usize, job: u32) -> Bridge {
        let port = Port::new(&INKS, rate);
        port.tear(job);
        Bridge::with(address, port)
    }

    fn with(address: SocketAddr, port: Port) -> Bridge {
        let (served, address) = served::Bridge::on_tcp(address, port).unwrap();
        Bridge { address, served }
    }

    pub fn uri(&self) -> String {
        format!("foilpress:/tcp/{}", self.address)
    }
}

impl Deref for Bridge {
    type Target = served::Bridge;

    fn deref(&self) -> &served::Bridge {
        &self.served
    }
}
