// A machine to look at and to change: a catapult that the built-in rules have made.

// Type, parent and face of each block.
const BLOCKS = [
  [0, -1, -1], [1, 0, 1], [1, 0, 3], [1, 2, 0], [1, 0, 2], [1, 4, 0], [35, 1, 6],
  [35, 3, 6], [35, 5, 6], [1, 0, 4], [1, 9, 0], [22, 10, 4], [1, 11, 2], [1, 12, 0],
  [30, 13, 6], [36, 14, 0], [63, 8, 1], [63, 7, 2], [63, 16, 6], [63, 17, 3], [1, 11, 1],
];

export const EXAMPLE = {
  task: "throwing",
  machine: BLOCKS.map(([type, parent, face_id], id) => ({ type, id, parent, face_id })),
};
