//! Offline inverse kinematics of cable-driven parallel robots with six deformable cables.
//!
//! The mathematics of a single pose lives in [`cdpr_core`]; this library adds what needs an
//! allocator, a file system or time:
//!
//! [`robot_file`] (what the robot is) → [`problem`] (one pose of it) → [`rigid`] (all solutions with
//! non-deformable cables) → [`continuation`] (from there to the deformable ones, and back), and beside
//! it [`complete`] (all of them, with a proof) → [`enumerate`] (the answer for one pose) → [`branches`]
//! (over a range of a parameter) → [`output`] (as text, JSON or a picture). The proofs are computed in
//! [`interval`] arithmetic, those of paths in [`dual`] intervals. [`workspace`] asks at every pose of a grid.
//! [`import`] makes robot files from those of other programs, [`cases`] reads many poses from a file, [`shape`]
//! knows the shape of each cable, which [`report`] shows on a page for a browser.
//! [`in_order`] asks for them on all cores, [`cli`] is the command line.

pub mod branches;
pub mod cases;
pub mod choice;
pub mod cli;
pub mod complete;
pub mod continuation;
pub mod dual;
pub mod enumerate;
pub mod forward;
pub mod import;
pub mod in_order;
pub mod input_file;
pub mod interval;
pub mod journal;
pub mod output;
pub mod problem;
pub mod report;
pub mod rigid;
pub mod robot_file;
pub mod shape;
pub mod simulate;
pub mod table;
mod toml_file;
pub mod workspace;
