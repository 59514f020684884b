"use strict";
if (page.dimensions === 3) {
  drawSlices();
  drawFound();
}
drawPlan();
