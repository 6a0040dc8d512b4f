// A machine to look at and to change: a catapult that the built-in rules have made.

export const EXAMPLE = {
  task: "throwing",
  machine: [
    { type: 0, id: 0, parent: -1, face_id: -1 },
    { type: 1, id: 1, parent: 0, face_id: 1 },
    { type: 1, id: 2, parent: 0, face_id: 3 },
    { type: 1, id: 3, parent: 2, face_id: 0 },
    { type: 1, id: 4, parent: 0, face_id: 2 },
    { type: 1, id: 5, parent: 4, face_id: 0 },
    { type: 35, id: 6, parent: 1, face_id: 6 },
    { type: 35, id: 7, parent: 3, face_id: 6 },
    { type: 35, id: 8, parent: 5, face_id: 6 },
    { type: 1, id: 9, parent: 0, face_id: 4 },
    { type: 1, id: 10, parent: 9, face_id: 0 },
    { type: 22, id: 11, parent: 10, face_id: 4 },
    { type: 1, id: 12, parent: 11, face_id: 2 },
    { type: 1, id: 13, parent: 12, face_id: 0 },
    { type: 30, id: 14, parent: 13, face_id: 6 },
    { type: 36, id: 15, parent: 14, face_id: 0 },
    { type: 63, id: 16, parent: 8, face_id: 1 },
    { type: 63, id: 17, parent: 7, face_id: 2 },
    { type: 63, id: 18, parent: 16, face_id: 6 },
    { type: 63, id: 19, parent: 17, face_id: 3 },
    { type: 1, id: 20, parent: 11, face_id: 1 },
  ],
};
