/* Tables that sort by every column, filter and turn pages: with the mouse, the keyboard or a screen reader. */
"use strict";
(() => {
  const NR = (window.NONRIGID = window.NONRIGID || {});

  /* Show a number with four digits, as the static tables do. */
  NR.cell = (value) => {
    if (value === null || value === undefined) return "";
    if (typeof value !== "number" || Number.isInteger(value)) return String(value);
    const size = Math.abs(value);
    if (size && (size < 1e-3 || size >= 1e5)) return value.toExponential(1);
    return size >= 1000 ? value.toFixed(0) : String(Number(value.toPrecision(4)));
  };

  /* Order two values: numbers before words, whatever is missing last in both directions. */
  const order = (a, b, sign) => {
    const lostA = a === null || a === undefined || a === "";
    const lostB = b === null || b === undefined || b === "";
    if (lostA || lostB) return lostA - lostB;
    if (typeof a === "number" && typeof b === "number") return sign * (a - b);
    return sign * String(a).localeCompare(String(b), undefined, { numeric: true });
  };

  /* rows: [{ values: [...], element: () => tr }]; options: { size, count, previous, next } */
  class Grid {
    constructor(table, rows, options = {}) {
      Object.assign(this, { table, rows, size: Infinity, page: 0, sorted: null, sign: 1, tests: new Map() }, options);
      this.found = rows;
      this.heads = [...table.tHead.rows[0].cells];
      this.heads.forEach((head, column) => {
        const button = document.createElement("button");
        button.type = "button";
        button.append(...head.childNodes);
        button.addEventListener("click", () => this.sort(column));
        head.append(button);
      });
      if (this.previous) {
        this.previous.addEventListener("click", () => this.turn(-1));
        this.next.addEventListener("click", () => this.turn(1));
      }
    }

    sort(column) {
      this.sign = this.sorted === column ? -this.sign : 1;
      this.sorted = column;
      this.heads.forEach((head, place) => {
        if (place === column) head.setAttribute("aria-sort", this.sign > 0 ? "ascending" : "descending");
        else head.removeAttribute("aria-sort");
      });
      this.update();
    }

    /* Keep rows for which the test holds; null drops the test of that name. */
    filter(name, test) {
      if (test) this.tests.set(name, test);
      else this.tests.delete(name);
      this.update();
    }

    turn(step) {
      this.page += step;
      this.show();
    }

    update() {
      const tests = [...this.tests.values()];
      this.found = this.rows.filter((row) => tests.every((test) => test(row.values)));
      if (this.sorted !== null) {
        const { sorted, sign } = this;
        this.found.sort((a, b) => order(a.values[sorted], b.values[sorted], sign));
      }
      this.page = 0;
      this.show();
    }

    show() {
      const pages = Math.max(1, Math.ceil(this.found.length / this.size));
      this.page = Math.min(Math.max(this.page, 0), pages - 1);
      const first = this.size === Infinity ? 0 : this.page * this.size;
      const shown = this.found.slice(first, first + this.size);
      this.table.tBodies[0].replaceChildren(...shown.map((row) => row.element()));
      if (this.count) {
        const range = shown.length < this.found.length ? `${first + 1} to ${first + shown.length} of ` : "";
        this.count.textContent = `${range}${this.found.length} shown of ${this.rows.length}`;
      }
      if (this.previous) {
        this.previous.disabled = this.page === 0;
        this.next.disabled = this.page >= pages - 1;
      }
    }
  }
  NR.Grid = Grid;

  const number = (text) => (text.trim() !== "" && Number.isFinite(Number(text)) ? Number(text) : text.trim());

  /* Make a table that stands in the page sortable. */
  NR.enliven = (table) => {
    const rows = [...table.tBodies[0].rows].map((element) => ({
      values: [...element.cells].map((cell) => number(cell.dataset.value ?? cell.textContent)),
      element: () => element,
    }));
    return new Grid(table, rows);
  };

  /* Fill a table from columns [{ heading, kind }] and rows of values; one select for each column of kind "choice". */
  NR.fill = (root, data) => {
    const table = root.querySelector("table");
    const head = table.createTHead().insertRow();
    data.columns.forEach((column) => {
      const cell = document.createElement("th");
      cell.scope = "col";
      cell.textContent = column.heading;
      if (column.kind === "number") cell.className = "number";
      head.append(cell);
    });
    table.createTBody();
    const rows = data.rows.map((values) => {
      let made = null;
      const element = () => {
        if (made) return made;
        made = document.createElement("tr");
        values.forEach((value, place) => {
          const cell = made.insertCell();
          const kind = data.columns[place].kind;
          if (kind === "number" || kind === "clip") cell.className = kind;
          if (kind === "clip") cell.title = value;
          if (kind === "link" && data.pages && data.pages[value]) {
            const link = document.createElement("a");
            link.href = data.pages[value];
            link.textContent = value;
            cell.append(link);
          } else cell.textContent = NR.cell(value);
        });
        return made;
      };
      return { values, element };
    });
    const grid = new Grid(table, rows, {
      size: 25,
      count: root.querySelector("[data-count]"),
      previous: root.querySelector("[data-previous]"),
      next: root.querySelector("[data-next]"),
    });
    const controls = root.querySelector("[data-filters]");
    data.columns.forEach((column, place) => {
      const choices = [...new Set(data.rows.map((values) => values[place]))];
      if (column.kind !== "choice" || choices.length < 2) return;
      const label = document.createElement("label");
      const select = document.createElement("select");
      select.append(new Option("all", ""), ...choices.map((choice) => new Option(choice, choice)));
      select.addEventListener("change", () =>
        grid.filter(place, select.value === "" ? null : (values) => String(values[place]) === select.value),
      );
      label.append(column.heading + " ", select);
      controls.append(label);
    });
    const search = root.querySelector("input[type=search]");
    search.addEventListener("input", () => {
      const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
      grid.filter("search", words.length
        ? (values) => words.every((word) => values.some((value) => String(value ?? "").toLowerCase().includes(word)))
        : null);
    });
    grid.update();
    return grid;
  };

  document.addEventListener("DOMContentLoaded", () => {
    document.querySelectorAll("table[data-sortable]").forEach(NR.enliven);
    document.querySelectorAll("[data-grid]").forEach((root) => {
      root.hidden = false;
      NR.grid = NR.fill(root, NR.tables[root.dataset.grid]);
    });
  });
})();
