//! The bytes of a table: see [`cdpr_core::table`] for the format.

use std::collections::HashMap;

use cdpr_core::table::{
    COORDINATES, CRC_BYTES, ELASTIC_CATENARY, MAGIC, MAX_SEEDS, MAX_WORDS, Node, SEED_BYTES,
    VERSION, WORD_BYTES, checksum, offset,
};
use cdpr_core::{CABLES, Load, Robot};

use super::Model;
use super::cells::{Cell, Plan, Seed};

/// Why a table cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WriteFault {
    /// Too many cells.
    #[error(
        "{0} cells of one kind are more than the format holds; take a smaller region or less depth"
    )]
    TooLarge(usize),
}

/// All that the header says.
pub(super) struct Header {
    pub(super) low: [f32; COORDINATES],
    pub(super) extent: [f32; COORDINATES],
    pub(super) sheet_pose: [f32; COORDINATES],
    pub(super) sheet_lengths_m: [f32; CABLES],
    pub(super) limits_m: [f32; CABLES],
}

/// Writes a table.
#[allow(clippy::cast_possible_truncation)] // parameters that are floats already, counts that were checked
pub(super) fn write(
    robot: &Robot<f64, Model>,
    load: &Load<f64>,
    header: &Header,
    plan: &Plan,
) -> Result<Vec<u8>, WriteFault> {
    let mut body = Body::default();
    let tree = body.tree(plan);
    for (count, most) in [(body.seeds.len(), MAX_SEEDS), (tree.len(), MAX_WORDS - 1)] {
        if count > most as usize {
            return Err(WriteFault::TooLarge(count));
        }
    }
    let total = offset::TREE + body.bytes(&tree) + CRC_BYTES;
    let mut bytes = Vec::with_capacity(total);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend([ELASTIC_CATENARY, body.steps]);
    for count in [total, tree.len(), body.seeds.len(), 0, 0] {
        bytes.extend((count as u32).to_le_bytes());
    }
    let mut floats = |values: &[f32]| bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    floats(&header.low);
    floats(&header.extent);
    floats(&header.sheet_pose);
    floats(&header.sheet_lengths_m);
    for cable in robot.cables() {
        floats(&cable.anchor_m.map(|c| c as f32).data.0[0]);
        floats(&cable.attachment_m.map(|c| c as f32).data.0[0]);
        floats(&[cable.model.weight_n_m as f32, cable.model.compliance_per_n as f32]);
    }
    floats(&[load.mass_kg as f32]);
    floats(&load.center_of_mass_m.map(|c| c as f32).data.0[0]);
    floats(&[load.gravity_m_s2 as f32]);
    floats(&load.force_n.map(|c| c as f32).data.0[0]);
    floats(&load.moment_nm.map(|c| c as f32).data.0[0]);
    floats(&header.limits_m);
    debug_assert_eq!(bytes.len(), offset::TREE);
    bytes.extend(tree.iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend(body.seeds.iter().flatten());
    bytes.extend(checksum(&bytes).to_le_bytes());
    Ok(bytes)
}

/// What a plan takes in a table.
pub(super) fn bytes(plan: &Plan) -> usize {
    let mut body = Body::default();
    let tree = body.tree(plan);
    body.bytes(&tree)
}

#[derive(Default)]
struct Body {
    seeds: Vec<Seed>,
    seed_numbers: HashMap<Seed, usize>,
    steps: u8,
}

impl Body {
    /// The words of a tree; its seeds and steps are kept.
    fn tree(&mut self, plan: &Plan) -> Vec<u16> {
        match plan {
            Plan::Split { coordinate, halves } => {
                let coordinate = usize::from(*coordinate);
                if let Some((k, gap)) = Plan::one_half(halves) {
                    let half = Node::Half { coordinate, is_upper: k == 1, inside: 0, gap };
                    return [words(half), self.tree(&halves[k])].concat();
                }
                let [lower, upper] = halves.each_ref().map(|half| self.tree(half));
                let node = Node::Split { coordinate, lower: 0, upper: lower.len() };
                [words(node), lower, upper].concat()
            }
            Plan::Cell(cell) => words(self.cell(cell)),
            Plan::Trim { plane, cell } => {
                let trim = Node::Trim { plane: *plane, inside: 0 };
                [words(trim), words(self.cell(cell))].concat()
            }
            Plan::Nothing(gap) => words(Node::Nothing(*gap)),
        }
    }

    fn bytes(&self, tree: &[u16]) -> usize {
        WORD_BYTES * tree.len() + SEED_BYTES * self.seeds.len()
    }

    fn cell(&mut self, cell: &Cell) -> Node {
        self.steps = self.steps.max(cell.steps);
        let next = self.seeds.len();
        let seed = *self.seed_numbers.entry(cell.seed).or_insert(next);
        if seed == next {
            self.seeds.push(cell.seed);
        }
        Node::Cell { seed }
    }
}

fn words(node: Node) -> Vec<u16> {
    let (words, count) = node.encode();
    words[..count].to_vec()
}
