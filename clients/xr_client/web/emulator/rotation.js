/**
 * Rotations as unit quaternions [x, y, z, w], and points as [x, y, z], in plain arrays.
 */

/** One rotation after another: first `b`, then `a`. */
export function multiply([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/** The same rotation, its rounding errors removed. */
export function unit(q) {
  const length = Math.hypot(...q);
  return q.map((x) => x / length);
}

/** The rotation back. */
export function inverse([x, y, z, w]) {
  return [-x, -y, -z, w];
}

/** A point, rotated. */
export function rotate(q, [x, y, z]) {
  return multiply(multiply(q, [x, y, z, 0]), inverse(q)).slice(0, 3);
}

/** The rotation about a unit axis by an angle [rad]. */
export function about([x, y, z], angle) {
  const s = Math.sin(angle / 2);
  return [x * s, y * s, z * s, Math.cos(angle / 2)];
}

/** The sum of two points. */
export function add([ax, ay, az], [bx, by, bz]) {
  return [ax + bx, ay + by, az + bz];
}

/**
 * What separates two poses, `a` to `b`: the pose of `b` seen from `a`.
 *
 * @param {{position: number[], orientation: number[]}} a
 * @param {{position: number[], orientation: number[]}} b
 */
export function between(a, b) {
  const back = inverse(a.orientation);
  return {
    position: rotate(back, add(b.position, a.position.map((x) => -x))),
    orientation: multiply(back, b.orientation),
  };
}

/** The pose of `b` in the room, where `a` is in the room and `b` is seen from `a`. */
export function compose(a, b) {
  return {
    position: add(a.position, rotate(a.orientation, b.position)),
    orientation: multiply(a.orientation, b.orientation),
  };
}

/** The pose that a rigid 4x4 matrix says, its columns one after another. */
export function poseOf(matrix) {
  const [a, d, g, , b, e, h, , c, f, i] = matrix;
  // Each row is the quaternion times four times one of its components; the longest one is divided by the least error.
  const rows = [
    [1 + a - e - i, b + d, c + g, h - f],
    [b + d, 1 - a + e - i, f + h, c - g],
    [c + g, f + h, 1 - a - e + i, d - b],
    [h - f, c - g, d - b, 1 + a + e + i],
  ];
  const longest = rows.reduce((best, row) => (Math.hypot(...row) > Math.hypot(...best) ? row : best));
  return { position: [...matrix.slice(12, 15)], orientation: unit(longest) };
}
