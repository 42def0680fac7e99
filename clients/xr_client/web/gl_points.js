/** Round points in the room: joints of hands, grips of controllers. */

import { buildProgram } from "./gl.js";

const VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
uniform mat4 clip;
uniform float size;
void main() {
  gl_Position = clip * vec4(position, 1.0);
  gl_PointSize = clamp(size / gl_Position.w, 2.0, 64.0);
}`;

const FRAGMENT = `#version 300 es
precision mediump float;
uniform vec3 tint;
out vec4 color;
void main() {
  float r = 2.0 * length(gl_PointCoord - 0.5);
  float shade = 1.0 - 0.45 * r * r;
  color = vec4(tint * shade, 1.0) * (1.0 - smoothstep(0.8, 1.0, r));
}`;

/** Draws spheres as far as a point can look like one. */
export class PointCloud {
  /**
   * Build the program.
   * @param {WebGL2RenderingContext} gl The context.
   */
  constructor(gl) {
    this._gl = gl;
    const { program, at } = buildProgram(gl, VERTEX, FRAGMENT, ["clip", "size", "tint"]);
    this._program = program;
    this._at = at;
    this._scale = 0;
    this._capacity = 0;
    this._buffer = gl.createBuffer();
    this._vertices = gl.createVertexArray();
    gl.bindVertexArray(this._vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, this._buffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindVertexArray(null);
  }

  /**
   * Take the points of a frame.
   * @param {import("./stage.js").Points|null} points The points.
   */
  place(points) {
    if (points === null || points.left + points.right === 0) {
      return;
    }
    const gl = this._gl;
    const numbers = 3 * (points.left + points.right);
    gl.bindBuffer(gl.ARRAY_BUFFER, this._buffer);
    if (points.xyz.length > this._capacity) {
      this._capacity = points.xyz.length;
      gl.bufferData(gl.ARRAY_BUFFER, points.xyz, gl.DYNAMIC_DRAW);
    } else {
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, points.xyz, 0, numbers);
    }
  }

  /**
   * Get ready to draw for an eye.
   * @param {Float32Array} clip Clip space from room, 4x4.
   * @param {number} scale Pixels of something of 1 m at 1 m.
   */
  begin(clip, scale) {
    this._scale = scale;
    this._gl.useProgram(this._program);
    this._gl.bindVertexArray(this._vertices);
    this._gl.uniformMatrix4fv(this._at.clip, false, clip);
  }

  /**
   * Draw some.
   * @param {number} first Index of the first.
   * @param {number} count How many.
   * @param {number} diameter Of each [m].
   * @param {number[]} tint Red to blue, 0 to 1.
   */
  draw(first, count, diameter, tint) {
    if (count > 0) {
      this._gl.uniform1f(this._at.size, diameter * this._scale);
      this._gl.uniform3f(this._at.tint, tint[0], tint[1], tint[2]);
      this._gl.drawArrays(this._gl.POINTS, first, count);
    }
  }
}
