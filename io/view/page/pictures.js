// SPDX-License-Identifier: Apache-2.0
// Pictures of gels and cameras: the newest one at a frame, with the name of its output. A picture
// is decoded when it is first needed; until then the one before stays.
class PictureView {
  // `ready`: called when a picture has been decoded.
  constructor(picture, index, ready) {
    Object.assign(this, { picture, index, ready, decoded: new Map() });
  }

  // The picture at a frame of an episode; null before the first, and while it is decoded.
  at(episode, frame) {
    const { at, jpeg } = episode.pictures[this.index], k = at[frame];
    if (k < 0) return null;
    const key = `${episode.label} ${k}`;
    if (!this.decoded.has(key)) {
      const image = new Image();
      image.onload = this.ready;
      image.src = `data:image/jpeg;base64,${jpeg[k]}`;
      this.decoded.set(key, image);
    }
    const image = this.decoded.get(key);
    return image.complete && image.naturalWidth > 0 ? image : null;
  }

  isTaken(episode, frame) { return episode.pictures[this.index].at[frame] >= 0; }

  // Height of the picture for a width [CSS pixels].
  height(width) { return width * this.picture.rows / this.picture.cols; }

  draw(g, width, height, episode, frame, ink) {
    const image = this.at(episode, frame);
    g.textBaseline = "alphabetic"; g.textAlign = "left";
    g.font = "600 13px system-ui, sans-serif"; g.fillStyle = ink;
    g.fillText(this.picture.name, 4, 14);
    if (!image) return;
    g.imageSmoothingEnabled = this.picture.cols >= width;
    g.drawImage(image, 0, 20, width, height - 20);
    this.canvas.dataset.shown = episode.pictures[this.index].at[frame];
  }
}
