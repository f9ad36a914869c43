// Reads SLEAP's files as tables of labels. They name frames by number unless the "video" is a list of
// pictures.
#pragma once

#include <optional>
#include <string>

#include "loaders/formats/foreign_hdf5.h"
#include "loaders/formats/label_table.h"

namespace q3d::loaders::formats {

// Reads a project or its predictions (.slp): labels made by hand, and predictions that nobody has corrected.
// Returns nothing if the file is no .slp. Throws std::runtime_error that names the place, what was found and
// what was expected. The frames of several videos are told apart by the names of the videos, so it refuses
// videos of one name, and labels of several skeletons.
std::optional<LabelTable> read_sleap_labels(const ForeignHdf5& file);

// Reads an exported analysis (.h5) of one video. The table has a row for each frame with an animal. Returns
// nothing if the file is no such export. Throws like read_sleap_labels.
std::optional<LabelTable> read_sleap_analysis(const ForeignHdf5& file);

// Returns whether the text is such an analysis as CSV. Its first line is
// "track,frame_idx,instance.score,nose.x,nose.y,nose.score,...".
bool is_sleap_csv(const std::string& text);
// Reads such a CSV. Throws std::runtime_error that names `where` and the line, what was found and what was
// expected.
LabelTable read_sleap_csv(const std::string& text, const std::string& where);

// Collects animals frame by frame into a table, in which each track is an individual. Animals without a
// track, and a second animal of the same track in a frame, are numbered within their frame ("animal_0").
class SleapTable {
 public:
  // `tracks` are the tracks' names. Tracks with the same name are distinguished by their number.
  SleapTable(std::vector<std::string> nodes, const std::vector<std::string>& tracks);

  // `video` is an index into the videos that finish() is given.
  void begin_frame(std::string name, std::size_t video = 0);
  struct Point {
    double x_px = 0.0;
    double y_px = 0.0;
    double likelihood = 1.0;  // 1 for labels made by hand
  };
  // Adds an animal to the frame that was begun last. `track` is an index into the tracks, or nothing.
  // Points that are not labelled have NaN coordinates. points: one for each node.
  void add_animal(std::optional<std::size_t> track, const std::vector<Point>& points);

  // Returns the table. Frames without an animal have no row. A single individual has no name.
  LabelTable finish(bool rows_are_numbers, std::vector<LabelVideo> videos = {}) const;

 private:
  struct Frame {
    std::string name;
    std::size_t video;
  };
  struct Animal {
    std::size_t row;
    std::size_t individual;
    std::vector<Point> points;
  };
  std::size_t individual_of(std::optional<std::size_t> track);
  std::size_t individual_named(const std::string& name);

  std::vector<std::string> nodes_;
  std::vector<std::string> tracks_;
  std::vector<Frame> rows_;
  std::vector<std::string> individuals_;
  std::vector<Animal> animals_;
  std::vector<std::size_t> in_frame_;  // individuals of the current frame
};

}  // namespace q3d::loaders::formats
