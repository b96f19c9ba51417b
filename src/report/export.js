// Every plot as SVG, PNG and CSV, made in the page.
const LOOK = ["fill", "stroke", "stroke-width", "stroke-dasharray", "stroke-linecap", "stroke-linejoin", "font-size", "font-family", "font-variant-numeric", "paint-order", "opacity"];

/// The drawing with its looks inside, on the page's ground.
function standalone(svg) {
  const copy = svg.cloneNode(true), from = [svg, ...svg.querySelectorAll("*")], to = [copy, ...copy.querySelectorAll("*")];
  from.forEach((e, k) => {
    const style = getComputedStyle(e);
    for (const name of LOOK) to[k].setAttribute(name, style.getPropertyValue(name));
    to[k].removeAttribute("class");
  });
  const { width, height } = svg.viewBox.baseVal;
  for (const [key, v] of [["xmlns", "http://www.w3.org/2000/svg"], ["width", width], ["height", height]]) copy.setAttribute(key, v);
  const ground = document.createElementNS("http://www.w3.org/2000/svg", "rect");
  for (const [key, v] of [["x", svg.viewBox.baseVal.x], ["width", width], ["height", height], ["fill", getComputedStyle(document.body).backgroundColor]]) ground.setAttribute(key, v);
  copy.prepend(ground);
  return new XMLSerializer().serializeToString(copy);
}

function save(name, kind, text) {
  const link = document.createElement("a");
  link.download = name;
  link.href = text.startsWith("data:") ? text : `data:${kind};charset=utf-8,${encodeURIComponent(text)}`;
  link.click();
}

/// Twice as many pixels as on the screen.
function raster(svg, name) {
  const image = new Image(), { width, height } = svg.viewBox.baseVal;
  image.onload = () => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [2 * width, 2 * height];
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    save(name, "image/png", canvas.toDataURL("image/png"));
  };
  image.src = "data:image/svg+xml;charset=utf-8," + encodeURIComponent(standalone(svg));
}

/// Three small buttons beside a caption; `table` gives the CSV.
function offer(caption, svg, name, table) {
  const file = name.toLowerCase().replaceAll(/[^a-z0-9]+/g, "-").replaceAll(/^-|-$/g, "");
  const box = add(caption, "span", "save");
  const kinds = { SVG: () => save(file + ".svg", "image/svg+xml", standalone(svg)), PNG: () => raster(svg, file + ".png"), CSV: () => save(file + ".csv", "text/csv", table()) };
  for (const kind of Object.keys(kinds)) {
    const button = add(box, "button", "", kind);
    button.type = "button";
    button.setAttribute("aria-label", `${name} as ${kind}`);
    button.addEventListener("click", kinds[kind]);
  }
}

/// The figures that stand in the page have their table with them.
function offerStills() {
  for (const figure of document.querySelectorAll("figure[data-csv]")) {
    const caption = figure.querySelector("figcaption");
    offer(caption, figure.querySelector("svg"), caption.querySelector("b").textContent, () => figure.dataset.csv);
  }
}
