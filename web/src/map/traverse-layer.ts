/** A traverse on the plan map: stops before and after adjustment with 95 % ellipses, rocks that tie, maps of sites. */

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import PointGeometry from "ol/geom/Point";
import Polygon from "ol/geom/Polygon";
import VectorLayer from "ol/layer/Vector";
import type OlMap from "ol/Map";
import VectorSource from "ol/source/Vector";
import CircleStyle from "ol/style/Circle";
import Fill from "ol/style/Fill";
import RegularShape from "ol/style/RegularShape";
import Stroke from "ol/style/Stroke";
import Style from "ol/style/Style";
import type { SiteMap } from "../api/frame-calls";
import { type Localization, SIGMAS_95, type Stop } from "../lib/traverse";
import { ellipse, type Point } from "./geometry";
import { closed, words } from "./styles";

export const TRAVERSE_COLORS = { before: "#ff9d3c", after: "#58d0f5", tie: "#8ff0a8", map: "#d9c7ff" };

const place = (values: readonly number[]): Point => [values[0] ?? 0, values[1] ?? 0];

export class TraverseLayer {
  private readonly layer = new VectorLayer({ source: new VectorSource(), zIndex: 7.5 });

  constructor(map: OlMap) {
    map.addLayer(this.layer);
  }

  /** Draw a traverse and the maps of sites; nulls draw nothing. */
  show(found: Localization | null, maps: readonly SiteMap[]): Point[] {
    const features = maps.map((map) => this.map(map));
    if (found !== null) {
      features.push(...this.traverse(found, "before"), ...this.traverse(found, "after"), ...this.ties(found));
    }
    const source = this.layer.getSource();
    source?.clear();
    source?.addFeatures(features);
    return (found?.stops ?? []).flatMap((stop) => [place(stop.believed_m), place(stop.adjusted_m)]);
  }

  private map(map: SiteMap): Feature {
    const feature = new Feature(new Polygon([closed(map.outline_m.map(place))]));
    feature.setStyle(
      new Style({
        stroke: new Stroke({ color: TRAVERSE_COLORS.map, width: 1.5, lineDash: [6, 4] }),
        text: words(`${map.name} ± ${map.sigma_m.toFixed(2)} m`, TRAVERSE_COLORS.map),
      }),
    );
    return feature;
  }

  private traverse(found: Localization, when: "before" | "after"): Feature[] {
    const color = TRAVERSE_COLORS[when];
    const at = (stop: Stop): Point => place(when === "before" ? stop.believed_m : stop.adjusted_m);
    const spread = (stop: Stop): number[][] =>
      when === "before" ? stop.believed_covariance_m2 : stop.adjusted_covariance_m2;
    const features = found.legs.map((leg) => {
      const ends = [leg.first, leg.second].flatMap((name) => found.stops.filter((stop) => stop.name === name).map(at));
      const feature = new Feature(new LineString(ends));
      const lineDash = when === "after" && leg.accepted ? undefined : [5, 5];
      feature.setStyle(new Style({ stroke: new Stroke({ color, width: when === "after" ? 2.5 : 1.5, lineDash }) }));
      return feature;
    });
    for (const stop of found.stops) {
      const around = new Feature(new Polygon([closed(ellipse(at(stop), spread(stop), SIGMAS_95))]));
      around.setStyle(new Style({ stroke: new Stroke({ color, width: 1.5 }), fill: new Fill({ color: `${color}26` }) }));
      const dot = new Feature(new PointGeometry(at(stop)));
      dot.setStyle(
        new Style({
          image: new CircleStyle({ radius: when === "after" ? 4.5 : 3.5, fill: new Fill({ color }) }),
          text: when === "after" ? words(stop.name.replace("ROVER_FRAME ", "").replace("SITE_FRAME ", "site "), "#ffffff", [0, -14]) : undefined,
        }),
      );
      features.push(around as unknown as Feature<LineString>, dot as unknown as Feature<LineString>);
    }
    return features;
  }

  private ties(found: Localization): Feature[] {
    const image = new RegularShape({ points: 3, radius: 5, fill: new Fill({ color: TRAVERSE_COLORS.tie }) });
    return found.legs
      .filter((leg) => leg.accepted)
      .flatMap((leg) =>
        leg.pairs.map((pair) => {
          const feature = new Feature(new PointGeometry(place(pair.first_m)));
          feature.setStyle(new Style({ image }));
          return feature;
        }),
      );
  }
}
