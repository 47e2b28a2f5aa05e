"use strict";
// Shows surfaces and arrows that are turned by dragging, by the arrow keys, and made larger by + and -.
// Triangles are painted from the farthest to the nearest; arrows lie above them all.
(() => {
  const LIGHT = [0.36, -0.48, 0.8], AMBIENT = 0.45, STEP = 0.12;

  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

  // A colour like #2166ac in a light between 0 and 1.
  function shaded(colour, light) {
    const parts = [1, 3, 5].map((at) => Math.round(light * parseInt(colour.slice(at, at + 2), 16)));
    return `rgb(${parts.join(",")})`;
  }

  class View {
    constructor(canvas, shown) {
      Object.assign(this, { canvas, shown, turned: shown.turned, raised: shown.raised, larger: 1 });
      this.faces = shown.faces.map(([i, j, k, colour]) => {
        const [a, b, c] = [i, j, k].map((at) => shown.points[at]);
        const normal = cross(minus(b, a), minus(c, a));
        const length = Math.hypot(...normal) || 1;
        // Which side is out is not known everywhere: both are lit alike.
        const light = AMBIENT + (1 - AMBIENT) * Math.abs(dot(normal, LIGHT)) / length;
        return { corners: [i, j, k], colour: shaded(shown.colours[colour], light) };
      });
      canvas.addEventListener("pointerdown", (event) => this.grab(event));
      canvas.addEventListener("pointermove", (event) => this.drag(event));
      canvas.addEventListener("keydown", (event) => this.press(event));
      addEventListener("resize", () => this.draw());
      this.draw();
    }

    grab(event) {
      this.from = [event.clientX, event.clientY];
      this.canvas.setPointerCapture(event.pointerId);
    }

    drag(event) {
      if (!event.buttons || !this.from) return;
      const [x, y] = this.from;
      this.turn(-0.01 * (event.clientX - x), 0.01 * (event.clientY - y));
      this.from = [event.clientX, event.clientY];
    }

    press(event) {
      const ways = { ArrowLeft: [STEP, 0], ArrowRight: [-STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
      const sizes = { "+": 1.15, "-": 1 / 1.15 };
      if (event.key in sizes) this.larger *= sizes[event.key];
      if (!(event.key in ways) && !(event.key in sizes)) return;
      event.preventDefault();
      this.turn(...(ways[event.key] || [0, 0]));
    }

    turn(about, up) {
      this.turned += about;
      this.raised = Math.max(-1.5, Math.min(1.5, this.raised + up));
      this.draw();
    }

    // Where a point is: across, down [pixels], and how near.
    place(point) {
      const [sine, cosine] = [Math.sin(this.turned), Math.cos(this.turned)];
      const across = -sine * point[0] + cosine * point[1];
      const toward = cosine * point[0] + sine * point[1];
      const up = Math.cos(this.raised) * point[2] - Math.sin(this.raised) * toward;
      const near = Math.cos(this.raised) * toward + Math.sin(this.raised) * point[2];
      return [this.middle[0] + this.scale * across, this.middle[1] - this.scale * up, near];
    }

    draw() {
      const { canvas, shown } = this, ratio = devicePixelRatio || 1;
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      [canvas.width, canvas.height] = [width * ratio, height * ratio];
      this.middle = [width / 2, height / 2];
      this.scale = this.larger * Math.min(width, height) / (2 * shown.reach);
      const brush = this.brush = canvas.getContext("2d");
      brush.scale(ratio, ratio);
      brush.lineJoin = "round";
      const places = shown.points.map((point) => this.place(point));
      const depth = (face) => face.corners.reduce((sum, at) => sum + places[at][2], 0);
      const order = this.faces.map((face) => [depth(face), face]).sort((one, other) => one[0] - other[0]);
      brush.lineWidth = 0.7;
      for (const [, { corners, colour }] of order) {
        brush.beginPath();
        for (const at of corners) brush.lineTo(places[at][0], places[at][1]);
        brush.closePath();
        brush.fillStyle = brush.strokeStyle = colour;
        brush.fill();
        brush.stroke();  // closes the seams
      }
      for (const arrow of shown.arrows) this.arrow(arrow);
      this.axes(height);
    }

    arrow({ tail, tip, colour, name }) {
      const [from, to] = [this.place(tail), this.place(tip)];
      const [across, down] = [to[0] - from[0], to[1] - from[1]], length = Math.hypot(across, down);
      const brush = this.brush;
      brush.strokeStyle = brush.fillStyle = colour;
      brush.lineWidth = 3;
      brush.beginPath();
      brush.moveTo(from[0], from[1]);
      brush.lineTo(to[0], to[1]);
      brush.stroke();
      if (length > 1) {
        const head = Math.min(13, length), [x, y] = [across / length, down / length];
        brush.beginPath();
        brush.moveTo(to[0] + 3 * x, to[1] + 3 * y);
        for (const side of [1, -1])
          brush.lineTo(to[0] - head * x - 0.4 * side * head * y, to[1] - head * y + 0.4 * side * head * x);
        brush.fill();
      }
      this.word(name, to[0] + 6, to[1] - 6, colour);
    }

    // The directions of the scene in a corner.
    axes(height) {
      const [middle, scale] = [this.middle, this.scale];
      Object.assign(this, { middle: [38, height - 38], scale: 24 });
      const brush = this.brush, [x0, y0] = this.place([0, 0, 0]);
      ["x", "y", "z"].forEach((name, at) => {
        const [x, y] = this.place([0, 1, 2].map((one) => Number(one === at)));
        brush.strokeStyle = "#22252a";
        brush.lineWidth = 1;
        brush.beginPath();
        brush.moveTo(x0, y0);
        brush.lineTo(x, y);
        brush.stroke();
        this.word(name, x0 + 1.3 * (x - x0) - 3, y0 + 1.3 * (y - y0) + 4, "#22252a");
      });
      Object.assign(this, { middle, scale });
    }

    word(text, x, y, colour) {
      const brush = this.brush;
      brush.font = "13px system-ui, sans-serif";
      brush.lineWidth = 3;
      brush.strokeStyle = "#fff";
      brush.strokeText(text, x, y);
      brush.fillStyle = colour;
      brush.fillText(text, x, y);
    }
  }

  for (const canvas of document.querySelectorAll("canvas.turned"))
    new View(canvas, JSON.parse(document.getElementById(canvas.dataset.of).textContent));
})();
