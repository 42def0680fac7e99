/** 4x4 matrices as WebGL takes them: 16 numbers, column-major. Results go into the first argument; nothing is made. */

/**
 * Product of two matrices.
 * @param {Float32Array} out Neither of the two.
 * @param {Float32Array} a Applied last.
 * @param {Float32Array} b Applied first.
 */
export function multiply(out, a, b) {
  for (let column = 0; column < 16; column += 4) {
    for (let row = 0; row < 4; row++) {
      out[column + row] =
        a[row] * b[column] + a[row + 4] * b[column + 1] + a[row + 8] * b[column + 2] + a[row + 12] * b[column + 3];
    }
  }
}

/**
 * A rigid motion.
 * @param {Float32Array} out The matrix.
 * @param {ArrayLike<number>} position Where to, three numbers [m].
 * @param {ArrayLike<number>} orientation Unit quaternion xyzw.
 */
export function fromPose(out, position, orientation) {
  const x = orientation[0];
  const y = orientation[1];
  const z = orientation[2];
  const w = orientation[3];
  out[0] = 1 - 2 * (y * y + z * z);
  out[1] = 2 * (x * y + z * w);
  out[2] = 2 * (x * z - y * w);
  out[3] = 0;
  out[4] = 2 * (x * y - z * w);
  out[5] = 1 - 2 * (x * x + z * z);
  out[6] = 2 * (y * z + x * w);
  out[7] = 0;
  out[8] = 2 * (x * z + y * w);
  out[9] = 2 * (y * z - x * w);
  out[10] = 1 - 2 * (x * x + y * y);
  out[11] = 0;
  out[12] = position[0];
  out[13] = position[1];
  out[14] = position[2];
  out[15] = 1;
}

/**
 * Take pitch and roll out of a rigid motion: what is left turns about the vertical and looks where it looked.
 * @param {Float32Array} T Changed in place; -z is forward and y is up.
 */
export function level(T) {
  let x = -T[8];
  let z = -T[10];
  if (Math.hypot(x, z) < 0.2) {
    // Looking at the floor or at the ceiling: the crown of the head points forward, or backward.
    const sign = T[9] > 0 ? 1 : -1;
    x = sign * T[4];
    z = sign * T[6];
  }
  const norm = Math.hypot(x, z) || 1;
  const sin = -x / norm;
  const cos = -z / norm;
  T.set([cos, 0, -sin, 0, 0, 1, 0, 0, sin, 0, cos, 0]);
}

/**
 * A square of half-width 1 as a rectangle that looks at the origin.
 * @param {Float32Array} out The matrix.
 * @param {number} elevation How far above the horizon its middle is seen [rad].
 * @param {number} distance Of its middle [m].
 * @param {number} halfWidth Half of its width [m].
 * @param {number} halfHeight Half of its height [m].
 */
export function facing(out, elevation, distance, halfWidth, halfHeight) {
  const sin = Math.sin(elevation);
  const cos = Math.cos(elevation);
  out.fill(0);
  out[0] = halfWidth;
  out[5] = halfHeight * cos;
  out[6] = halfHeight * sin;
  out[9] = -sin;
  out[10] = cos;
  out[13] = distance * sin;
  out[14] = -distance * cos;
  out[15] = 1;
}
