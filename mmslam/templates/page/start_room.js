"use strict";
const literal = (thing) => ({
  ...thing,
  text: thing.labels ? thing.label_of.map((i) => plainText(thing.labels[i])) : plainText(thing.text),
});
drawSpace(document.getElementById("space-plot"), document.getElementById("space-layers"), page.things.map(literal));
