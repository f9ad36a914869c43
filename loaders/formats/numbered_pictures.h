// Finds the pictures of a video by the numbers in their names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace q3d::loaders::formats {

// Maps the number of a frame to the picture whose name ends in it ("frames/img0012.png"). The predictions of
// a video have no other link to their pictures.
class NumberedPictures {
 public:
  // Lists the JPEG and PNG files of a folder, whose names may end in a number.
  explicit NumberedPictures(const std::filesystem::path& folder);

  // Says why frames and pictures may be counted from different numbers. Returns "" if there is no doubt.
  // `rows` are the numbers of the frames. There is no doubt if every frame has its picture and every picture
  // its frame. Otherwise there is doubt if the pictures are numbered from 1 without a gap, as ffmpeg does it,
  // or if a frame has no picture while there are as many pictures as frames, or pictures of other numbers.
  std::string doubt(const std::vector<std::string>& rows) const;

  // Returns whether the pictures are numbered from 0 without a gap and are fewer than the frames. They may be
  // the first frames, or every n-th one with a new number; their names do not tell.
  bool may_be_every_nth(const std::vector<std::string>& rows) const;

  // Returns the picture of a frame, where `first_frame` is the number of the picture that shows frame 0. If
  // there is no such picture, or more than one, returns the number itself. No file has that name, so the
  // record fails.
  std::string name_of(const std::string& row, int first_frame) const;

 private:
  std::map<std::int64_t, std::set<std::string>> names_;
};

}  // namespace q3d::loaders::formats
