"use strict";
drawPlan();
if (page.dimensions === 3) {
  drawSlices();
  drawSpace(document.getElementById("space-plot"), document.getElementById("space-layers"), thingsFound());
}
